// The library and reading functions of oiio_shim.h, for OpenImageIO 2.4 to 3.x: only calls that all versions have.
#include "common.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

static_assert(sizeof(OiioSpec) == 14 * 4, "src/types.rs declares 14 words");
static_assert(sizeof(OiioLevel) == 4 * 4, "src/types.rs declares four words");
static_assert(sizeof(void*) != 8 || sizeof(OiioAttribute) == 40, "src/types.rs declares five words");

namespace {

using OIIO::ImageInput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;
using shim::Failure;
using shim::guard;
using shim::or_else;
using shim::require;

// Further subimages are not counted: each costs a seek, and no image has that many.
constexpr int kMaxSubimages = 4096;

OiioFormat format_of(TypeDesc type) {
  switch (type.basetype) {
    case TypeDesc::UINT8: return OIIO_FORMAT_U8;
    case TypeDesc::UINT16: return OIIO_FORMAT_U16;
    case TypeDesc::UINT32: return OIIO_FORMAT_U32;
    case TypeDesc::HALF: return OIIO_FORMAT_HALF;
    case TypeDesc::FLOAT: return OIIO_FORMAT_FLOAT;
    case TypeDesc::DOUBLE: return OIIO_FORMAT_DOUBLE;
    case TypeDesc::INT8: return OIIO_FORMAT_I8;
    case TypeDesc::INT16: return OIIO_FORMAT_I16;
    case TypeDesc::INT32: return OIIO_FORMAT_I32;
    default: return OIIO_FORMAT_UNKNOWN;
  }
}

// Held while a header is read. OpenImageIO up to 2.4 looks up the tags of ICC profiles by operator[] of a static map, which
// adds those that it lacks: two files with profiles that are opened at once destroy the map.
std::mutex& header_mutex() {
  static std::mutex mutex;
  return mutex;
}

// Header of a subimage, with the strings that callers hold pointers to.
struct Part {
  ImageSpec spec;
  std::vector<std::string> channels;
  std::vector<std::string> types, values;
};

}  // namespace

struct OiioInput {
  ImageInput::unique_ptr input;
  std::map<int, std::unique_ptr<Part>> parts;
  int subimages = 0;  // 0: not counted yet

  // OpenImageIO would print pending errors when the reader is destroyed.
  ~OiioInput() {
    if (input) drain();
  }

  std::string drain() { return input->has_error() ? input->geterror() : std::string(); }

  // Goes to a level of a subimage, of which most formats read the header then. Whatever is read next stays there.
  bool seek(int32_t subimage, int32_t level = 0) {
    const std::lock_guard<std::mutex> lock(header_mutex());
    return input->seek_subimage(subimage, level);
  }

  const Part& part(int32_t subimage) {
    require(subimage >= 0, "negative subimage index");
    auto found = parts.find(subimage);
    if (found != parts.end()) return *found->second;
    if (!seek(subimage))
      throw Failure{OIIO_CANNOT_READ, or_else(drain(), "the file has no such subimage")};

    auto part = std::make_unique<Part>();
    part->spec = input->spec();
    for (int c = 0; c < part->spec.nchannels; ++c) part->channels.push_back(part->spec.channel_name(c));
    for (const auto& entry : part->spec.extra_attribs) {
      part->types.emplace_back(entry.type().c_str());
      part->values.push_back(ImageSpec::metadata_val(entry, false));
      // A single string would be quoted, with its quotes and control characters escaped.
      if (entry.type() == OIIO::TypeString) part->values.back() = entry.get_string();
    }
    return *(parts[subimage] = std::move(part));
  }

  // Number of values of a subimage, after checking its header.
  uint64_t value_count(int32_t subimage, uint64_t max_bytes) {
    const ImageSpec& spec = part(subimage).spec;
    if (spec.deep) throw Failure{OIIO_UNSUPPORTED, "deep images are not supported"};
    if (spec.depth > 1) throw Failure{OIIO_UNSUPPORTED, "volume images are not supported"};
    const std::string size = std::to_string(spec.width) + " x " + std::to_string(spec.height) + " pixels of " +
                             std::to_string(spec.nchannels) + " channels";
    if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0)
      throw Failure{OIIO_UNSUPPORTED, "the header says " + size};
    // Each factor is below 2^31, so the first product fits; the second is avoided by a division.
    const uint64_t row = uint64_t(spec.width) * uint64_t(spec.nchannels);
    // A damaged header may ask for tiles larger than the image, which OpenImageIO would allocate.
    const uint64_t tile = uint64_t(std::max(spec.tile_width, 0)) * uint64_t(std::max(spec.tile_height, 0));
    if (tile > max_bytes / sizeof(float) / uint64_t(spec.nchannels))
      throw Failure{OIIO_TOO_LARGE, "the header asks for tiles of " + std::to_string(spec.tile_width) + " x " +
                                        std::to_string(spec.tile_height) + ", the limit is " +
                                        std::to_string(max_bytes >> 20) + " MiB (damaged file?)"};
    if (row > max_bytes / sizeof(float) / uint64_t(spec.height))
      throw Failure{OIIO_TOO_LARGE, "the header says " + size + ", more than the limit of " +
                                        std::to_string(max_bytes >> 20) + " MiB (damaged file?)"};
    return row * uint64_t(spec.height);
  }

  // Header of a level of a subimage.
  ImageSpec level(int32_t subimage, int32_t level) {
    require(subimage >= 0 && level >= 0, "negative index");
    seek(subimage, level);
    const ImageSpec spec = input->spec_dimensions(subimage, level);
    drain();
    const bool usable = !spec.deep && spec.depth <= 1 && spec.width > 0 && spec.height > 0 && spec.nchannels > 0;
    if (!usable) throw Failure{OIIO_UNSUPPORTED, "the file has no such level"};
    return spec;
  }
};

namespace {

// Columns or rows [begin, end) of a level.
struct Span {
  int begin, end;

  // The span of whole tiles that contain it, in a level of `size` columns or rows; everything if there are no tiles.
  Span of_tiles(int tile, int size) const {
    if (tile <= 0) return {0, size};
    return {begin / tile * tile, int(std::min<int64_t>(size, (int64_t(end) + tile - 1) / tile * tile))};
  }
};

// Rows of a file without tiles that are read together: whole strips. OpenImageIO takes as much memory again for rows
// that it converts.
int64_t rows_of_block(const ImageSpec& spec) {
  constexpr int64_t kRows = 256;
  const int64_t strip = std::max(spec.get_int_attribute("tiff:RowsPerStrip", 1), 1);
  return (kRows + strip - 1) / strip * strip;
}

}  // namespace

// ---- library ----

int32_t oiio_shim_abi(void) { return OIIO_SHIM_ABI; }

const char* oiio_shim_version(void) {
  static char text[32] = "";
  static const bool filled = [] {
    const int version = OIIO::openimageio_version();
    std::snprintf(text, sizeof text, "%d.%d.%d", version / 10000, version / 100 % 100, version % 100);
    return true;
  }();
  (void)filled;
  return text;
}

const char* oiio_shim_extensions(void) {
  try {
    static const std::string list(OIIO::get_string_attribute("extension_list"));
    return list.c_str();
  } catch (...) {
    return "";
  }
}

int32_t oiio_shim_set_int(const char* name, int32_t value, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(name != nullptr, "null name");
    const int number = value;
    if (!OIIO::attribute(name, OIIO::TypeInt, &number))
      throw Failure{OIIO_INVALID_ARGUMENT, std::string("OpenImageIO has no global attribute ") + name};
  });
}

// ---- reading ----

int32_t oiio_shim_input_open(const char* path, int32_t unassociated_alpha, OiioInput** input, char* error,
                             size_t error_size) {
  return guard(error, error_size, [&] {
    require(path != nullptr && input != nullptr, "null argument");
    *input = nullptr;
    ImageSpec config;
    if (unassociated_alpha != 0) config.attribute("oiio:UnassociatedAlpha", 1);
    auto opened = std::make_unique<OiioInput>();
    {
      const std::lock_guard<std::mutex> lock(header_mutex());
      opened->input = ImageInput::open(path, &config);
    }
    if (!opened->input)
      throw Failure{OIIO_CANNOT_OPEN, or_else(OIIO::geterror(), "not a picture that OpenImageIO can read")};
    *input = opened.release();
  });
}

const char* oiio_shim_input_format_name(OiioInput* input) {
  return input != nullptr && input->input ? input->input->format_name() : "";
}

int32_t oiio_shim_input_subimages(OiioInput* input, int32_t* count, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && count != nullptr, "null argument");
    if (input->subimages == 0) {
      // Some formats have the number in the header; in others only seeking can find it.
      int number = input->part(0).spec.get_int_attribute("oiio:subimages", 0);
      if (number <= 0)
        for (number = 1; number < kMaxSubimages && input->seek(number);) ++number;
      input->drain();
      input->subimages = number;
    }
    *count = input->subimages;
  });
}

int32_t oiio_shim_input_spec(OiioInput* input, int32_t subimage, OiioSpec* out, char* error,
                             size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && out != nullptr, "null argument");
    const ImageSpec& spec = input->part(subimage).spec;
    out->width = spec.width;
    out->height = spec.height;
    out->depth = spec.depth;
    out->x = spec.x;
    out->y = spec.y;
    out->full_x = spec.full_x;
    out->full_y = spec.full_y;
    out->full_width = spec.full_width;
    out->full_height = spec.full_height;
    out->nchannels = spec.nchannels;
    out->format = format_of(spec.format);
    out->alpha_channel = spec.alpha_channel;
    out->deep = spec.deep ? 1 : 0;
    out->attributes = int32_t(spec.extra_attribs.size());
  });
}

int32_t oiio_shim_input_channel(OiioInput* input, int32_t subimage, int32_t channel, const char** name,
                                int32_t* format, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && name != nullptr && format != nullptr, "null argument");
    const Part& part = input->part(subimage);
    require(channel >= 0 && size_t(channel) < part.channels.size(), "no such channel");
    *name = part.channels[size_t(channel)].c_str();
    *format = format_of(part.spec.channelformat(channel));
  });
}

int32_t oiio_shim_input_attribute(OiioInput* input, int32_t subimage, int32_t index, OiioAttribute* out,
                                  char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && out != nullptr, "null argument");
    const Part& part = input->part(subimage);
    require(index >= 0 && size_t(index) < part.values.size(), "no such attribute");
    const auto& entry = part.spec.extra_attribs[size_t(index)];
    const bool plain = entry.type().basetype != TypeDesc::STRING && entry.type().basetype != TypeDesc::PTR;
    out->name = entry.name().c_str();
    out->type = part.types[size_t(index)].c_str();
    out->value = part.values[size_t(index)].c_str();
    out->data = plain ? entry.data() : nullptr;
    out->bytes = plain ? size_t(entry.datasize()) : 0;
  });
}

int32_t oiio_shim_input_value_count(OiioInput* input, int32_t subimage, uint64_t max_bytes, uint64_t* count,
                                    char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && count != nullptr, "null argument");
    *count = input->value_count(subimage, max_bytes);
  });
}

int32_t oiio_shim_input_level(OiioInput* input, int32_t subimage, int32_t level, OiioLevel* out, char* error,
                              size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && out != nullptr, "null argument");
    const ImageSpec spec = input->level(subimage, level);
    *out = {spec.width, spec.height, spec.tile_width, spec.tile_height};
  });
}

int32_t oiio_shim_input_read_region(OiioInput* input, int32_t subimage, int32_t level, int32_t x, int32_t y,
                                    int32_t width, int32_t height, int32_t channel_begin, int32_t channel_end,
                                    int32_t format, void* values, uint64_t count, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(input != nullptr && values != nullptr, "null argument");
    require(format == OIIO_FORMAT_U8 || format == OIIO_FORMAT_FLOAT, "values are read as bytes or floats");
    const int64_t rows_of_part = rows_of_block(input->part(subimage).spec);
    const ImageSpec spec = input->level(subimage, level);
    require(x >= 0 && y >= 0 && width > 0 && height > 0 && width <= spec.width - x && height <= spec.height - y,
            "pixels outside of the level");
    require(channel_begin >= 0 && channel_begin < channel_end && channel_end <= spec.nchannels, "no such channels");
    const uint64_t channels = uint64_t(channel_end - channel_begin);
    require(count == uint64_t(width) * uint64_t(height) * channels, "the number of values is not that of the pixels");

    // Files are read in whole tiles or whole rows, in blocks.
    const TypeDesc type(format == OIIO_FORMAT_U8 ? TypeDesc::UINT8 : TypeDesc::FLOAT);
    const uint64_t pixel = channels * type.size();
    const bool tiled = spec.tile_width > 0 && spec.tile_height > 0;
    const Span columns = Span{x, x + width}.of_tiles(tiled ? spec.tile_width : 0, spec.width);
    const uint64_t row = uint64_t(columns.end - columns.begin) * pixel;
    const int64_t together = tiled ? spec.tile_height : rows_of_part;
    std::vector<char> block;
    for (int begin = y; begin < y + height;) {
      const int end = int(std::min<int64_t>(y + height, (begin / together + 1) * together));
      const Span rows = tiled ? Span{begin, end}.of_tiles(spec.tile_height, spec.height) : Span{begin, end};
      const bool exact = columns.end - columns.begin == width && rows.end - rows.begin == end - begin;
      if (!exact) block.resize(size_t(row * uint64_t(rows.end - rows.begin)));
      char* const wanted = static_cast<char*>(values) + uint64_t(begin - y) * uint64_t(width) * pixel;
      char* const target = exact ? wanted : block.data();
      const bool read = tiled ? input->input->read_tiles(subimage, level, spec.x + columns.begin, spec.x + columns.end,
                                                         spec.y + rows.begin, spec.y + rows.end, spec.z, spec.z + 1,
                                                         channel_begin, channel_end, type, target)
                              : input->input->read_scanlines(subimage, level, spec.y + rows.begin, spec.y + rows.end,
                                                             spec.z, channel_begin, channel_end, type, target);
      if (!read) throw Failure{OIIO_CANNOT_READ, or_else(input->drain(), "the pixels cannot be read")};
      const uint64_t left = uint64_t(x - columns.begin) * pixel;
      for (int i = 0; !exact && i < end - begin; ++i)
        std::copy_n(target + uint64_t(begin - rows.begin + i) * row + left, uint64_t(width) * pixel,
                    wanted + uint64_t(i) * uint64_t(width) * pixel);
      begin = end;
    }
  });
}

void oiio_shim_input_close(OiioInput* input) {
  guard(nullptr, 0, [&] { delete input; });
}
