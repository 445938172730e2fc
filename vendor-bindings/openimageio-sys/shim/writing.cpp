// The writing functions of oiio_shim.h, for OpenImageIO 2.4 to 3.x: only calls that all versions have.
#include "common.h"

#include <OpenImageIO/filesystem.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <vector>

static_assert(sizeof(void*) != 8 || sizeof(OiioPart) == 72, "src/types.rs declares 72 bytes");

namespace {

using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;
using shim::Failure;
using shim::guard;
using shim::or_else;
using shim::require;

// libjpeg ends the process if an image is larger.
constexpr int kMaxJpegSize = 65500;

TypeDesc type_of(int32_t format) {
  switch (format) {
    case OIIO_FORMAT_U8: return TypeDesc(TypeDesc::UINT8);
    case OIIO_FORMAT_U16: return TypeDesc(TypeDesc::UINT16);
    case OIIO_FORMAT_U32: return TypeDesc(TypeDesc::UINT32);
    case OIIO_FORMAT_HALF: return TypeDesc(TypeDesc::HALF);
    case OIIO_FORMAT_FLOAT: return TypeDesc(TypeDesc::FLOAT);
    case OIIO_FORMAT_DOUBLE: return TypeDesc(TypeDesc::DOUBLE);
    case OIIO_FORMAT_I8: return TypeDesc(TypeDesc::INT8);
    case OIIO_FORMAT_I16: return TypeDesc(TypeDesc::INT16);
    case OIIO_FORMAT_I32: return TypeDesc(TypeDesc::INT32);
    default: throw Failure{OIIO_INVALID_ARGUMENT, "unknown channel format"};
  }
}

// ---- a file whose every failed write is remembered ----

// Encoders are not told about a full disk: they write the end of a file in destructors, which cannot report errors, and
// libjpeg would end the process. Therefore every write seems to succeed. The first error is stored, and the shim checks
// for it after each step. proxytype() must not be "file", by which encoders recognise OpenImageIO's own class and cast
// to it. tell() and flush() are not overridden, since their constness differs between versions: the base class uses
// m_pos, and finish() flushes.
class CheckedFile final : public OIIO::Filesystem::IOProxy {
 public:
  explicit CheckedFile(const std::string& path)
      : IOProxy(path, Write), file_(OIIO::Filesystem::fopen(path, "wb")) {
    if (file_ == nullptr) remember();
  }
  ~CheckedFile() override { finish(); }
  CheckedFile(const CheckedFile&) = delete;
  CheckedFile& operator=(const CheckedFile&) = delete;

  const char* proxytype() const override { return "lumiris"; }
  void close() override {}  // the encoder's close; finish() closes
  bool opened() const override { return true; }

  bool seek(int64_t offset) override {
    if (errno_ == 0 && OIIO::Filesystem::fseek(file_, offset, SEEK_SET) != 0) remember();
    m_pos = offset;
    return true;
  }

  size_t write(const void* data, size_t size) override {
    if (errno_ == 0 && std::fwrite(data, 1, size, file_) != size) remember();
    m_pos += int64_t(size);
    if (m_pos > size_) size_ = m_pos;
    return size;
  }

  size_t pwrite(const void* data, size_t size, int64_t offset) override {
    const int64_t position = m_pos;
    seek(offset);
    write(data, size);
    seek(position);
    return size;
  }

  size_t size() const override { return size_t(size_); }

  // Closes the file. Returns the first error of any operation, or 0.
  int finish() noexcept {
    if (file_ != nullptr && std::fclose(file_) != 0) remember();
    file_ = nullptr;
    return errno_;
  }

  int first_error() const { return errno_; }

 private:
  void remember() noexcept {
    if (errno_ == 0) errno_ = errno != 0 ? errno : EIO;
  }

  std::FILE* file_;
  int64_t size_ = 0;
  int errno_ = 0;
};

}  // namespace

struct OiioOutput {
  std::string path;
  std::vector<ImageSpec> specs;
  std::unique_ptr<CheckedFile> file;  // outlives the encoder, which is destroyed first
  ImageOutput::unique_ptr output;
  int part = -1;  // the part being written; -1: not opened
  int rows = 0;   // rows of it written
  bool closed = false;

  ~OiioOutput() { drain(); }

  std::string drain() { return output && output->has_error() ? output->geterror() : std::string(); }

  // Throws if the encoder failed, or if the file failed without the encoder's knowledge.
  void check(bool ok, const char* what) {
    const std::string message = drain();
    const int reason = file ? file->first_error() : 0;
    if (reason != 0) throw Failure{OIIO_CANNOT_WRITE, path + ": " + std::strerror(reason)};
    if (!ok) throw Failure{OIIO_CANNOT_WRITE, path + ": " + or_else(message, what)};
  }

  ImageSpec& spec(int32_t index) {
    require(index >= 0 && size_t(index) < specs.size(), "no such part");
    require(part < 0 && !closed, "the file is already open");
    return specs[size_t(index)];
  }

  void open() {
    require(!specs.empty(), "a file needs a part");
    require(part < 0 && !closed, "the file is already open");
    // Other formats claim to hold several images, but TIFF then loses all except one without an error.
    const std::string format = output->format_name();
    if (specs.size() > 1 && format != "openexr")
      throw Failure{OIIO_UNSUPPORTED, format + " files are written with one part only"};
    if (output->supports("ioproxy")) {
      file = std::make_unique<CheckedFile>(path);
      check(true, "");
      require(output->set_ioproxy(file.get()), "the encoder refused the file");
    }
    const bool ok = specs.size() == 1 ? output->open(path, specs[0])
                                      : output->open(path, int(specs.size()), specs.data());
    check(ok, "cannot write the header");
    part = 0;
  }

  void write(int32_t to_part, int32_t row_begin, int32_t count_rows, const float* pixels, uint64_t count) {
    require(part >= 0 && !closed, "the file is not open");
    // Begin the next part once this one is full.
    if (to_part == part + 1 && rows == specs[size_t(part)].height && size_t(to_part) < specs.size()) {
      check(output->open(path, specs[size_t(to_part)], ImageOutput::AppendSubimage),
            "cannot begin the next part");
      part = to_part;
      rows = 0;
    }
    require(to_part == part, "parts must be written in order and in full");
    const ImageSpec& spec = specs[size_t(part)];
    require(row_begin == rows && count_rows > 0 && count_rows <= spec.height - rows,
            "rows must be written in order and within the image");
    require(count == uint64_t(count_rows) * uint64_t(spec.width) * uint64_t(spec.nchannels),
            "the number of floats is not rows * width * channels");

    const bool whole = count_rows == spec.height;
    const int y = spec.y + row_begin;
    const TypeDesc type(TypeDesc::FLOAT);
    const bool ok = whole ? output->write_image(type, pixels)
                          : output->write_scanlines(y, y + count_rows, 0, type, pixels);
    check(ok, "cannot write pixels");
    rows += count_rows;
  }

  void close() {
    require(part >= 0 && !closed, "the file is not open");
    closed = true;
    const bool complete = size_t(part) + 1 == specs.size() && rows == specs.back().height;
    const bool ok = output->close();
    const std::string message = drain();
    output.reset();
    const int reason = file ? file->finish() : 0;
    if (reason != 0) throw Failure{OIIO_CANNOT_WRITE, path + ": " + std::strerror(reason)};
    if (!ok) throw Failure{OIIO_CANNOT_WRITE, path + ": " + or_else(message, "cannot end the file")};
    if (!complete) throw Failure{OIIO_INVALID_ARGUMENT, "the file was closed before all rows were written"};
  }
};

int32_t oiio_shim_output_create(const char* path, OiioOutput** output, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(path != nullptr && output != nullptr, "null argument");
    *output = nullptr;
    auto created = std::make_unique<OiioOutput>();
    created->path = path;
    created->output = ImageOutput::create(path);
    if (!created->output)
      throw Failure{OIIO_UNSUPPORTED, or_else(OIIO::geterror(), "no encoder for this file extension")};
    *output = created.release();
  });
}

int32_t oiio_shim_output_add_part(OiioOutput* output, const OiioPart* part, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && part != nullptr, "null argument");
    require(output->part < 0 && !output->closed, "the file is already open");
    require(part->width > 0 && part->height > 0 && part->nchannels > 0, "a part needs pixels and channels");
    require(part->channel_names != nullptr && part->channel_formats != nullptr, "null channels");

    ImageSpec spec(part->width, part->height, part->nchannels, type_of(part->channel_formats[0]));
    spec.x = part->x;
    spec.y = part->y;
    const bool has_full = part->full_width > 0 && part->full_height > 0;
    spec.full_x = has_full ? part->full_x : part->x;
    spec.full_y = has_full ? part->full_y : part->y;
    spec.full_width = has_full ? part->full_width : part->width;
    spec.full_height = has_full ? part->full_height : part->height;

    // Name the channels; set a format per channel only if the formats differ.
    spec.channelnames.clear();
    std::vector<TypeDesc> formats;
    bool same = true;
    for (int c = 0; c < part->nchannels; ++c) {
      require(part->channel_names[c] != nullptr, "null channel name");
      spec.channelnames.emplace_back(part->channel_names[c]);
      formats.push_back(type_of(part->channel_formats[c]));
      same = same && formats[size_t(c)] == formats[0];
      if (formats[size_t(c)].basesize() > spec.format.basesize()) spec.format = formats[size_t(c)];
    }
    const std::string format = output->output->format_name();
    if (format == "jpeg" && (part->width > kMaxJpegSize || part->height > kMaxJpegSize))
      throw Failure{OIIO_UNSUPPORTED, "jpeg files have at most 65500 pixels per side"};
    if (!same) {
      if (!output->output->supports("channelformats"))
        throw Failure{OIIO_UNSUPPORTED, format + " files have one format for all channels"};
      spec.channelformats = formats;
    }
    spec.alpha_channel = -1;
    for (int c = 0; c < part->nchannels; ++c)
      if (spec.channelnames[size_t(c)] == "A") spec.alpha_channel = c;

    if (part->name != nullptr) spec.attribute("oiio:subimagename", part->name);
    if (part->compression != nullptr) spec.attribute("compression", part->compression);
    output->specs.push_back(std::move(spec));
  });
}

int32_t oiio_shim_output_set_string(OiioOutput* output, int32_t part, const char* name, const char* value,
                                    char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && name != nullptr && value != nullptr, "null argument");
    output->spec(part).attribute(name, value);
  });
}

int32_t oiio_shim_output_set_int(OiioOutput* output, int32_t part, const char* name, int32_t value, char* error,
                                 size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && name != nullptr, "null argument");
    output->spec(part).attribute(name, int(value));
  });
}

int32_t oiio_shim_output_set_float(OiioOutput* output, int32_t part, const char* name, float value, char* error,
                                   size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && name != nullptr, "null argument");
    output->spec(part).attribute(name, value);
  });
}

int32_t oiio_shim_output_set_matrix(OiioOutput* output, int32_t part, const char* name, const float* value,
                                    char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && name != nullptr && value != nullptr, "null argument");
    output->spec(part).attribute(name, OIIO::TypeMatrix, value);
  });
}

int32_t oiio_shim_output_open(OiioOutput* output, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr, "null argument");
    output->open();
  });
}

int32_t oiio_shim_output_write(OiioOutput* output, int32_t part, int32_t row_begin, int32_t rows,
                               const float* pixels, uint64_t count, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr && pixels != nullptr, "null argument");
    output->write(part, row_begin, rows, pixels, count);
  });
}

int32_t oiio_shim_output_close(OiioOutput* output, char* error, size_t error_size) {
  return guard(error, error_size, [&] {
    require(output != nullptr, "null argument");
    output->close();
  });
}

void oiio_shim_output_free(OiioOutput* output) {
  guard(nullptr, 0, [&] { delete output; });
}
