// The colour functions of oiio_shim.h, for OpenImageIO 2.4 to 3.x: only calls that all versions have.
#include "common.h"

#include <OpenImageIO/color.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <algorithm>

namespace {

using shim::Failure;
using shim::require;

// Pixels per transform: ImageBuf counts columns by int.
constexpr uint64_t kPixelsAtOnce = 1 << 20;

std::string or_default(const char* name, const char* otherwise) {
  if (name[0] != '\0') return name;
  return otherwise == nullptr ? std::string() : std::string(otherwise);
}

}  // namespace

extern "C" int32_t oiio_shim_ocio_display(const char* input, const char* display, const char* view,
                                          const char* looks, float* pixels, uint64_t count, char* chosen,
                                          size_t chosen_size, char* error, size_t error_size) {
  return shim::guard(error, error_size, [&] {
    require(input != nullptr && display != nullptr && view != nullptr && looks != nullptr, "null name");
    require(pixels != nullptr || count == 0, "null pixels");
    require(count % 3 == 0, "pixels are RGB triples");
    if (!OIIO::ColorConfig::supportsOpenColorIO()) {
      throw Failure{OIIO_UNSUPPORTED, "this OpenImageIO was built without OpenColorIO"};
    }
    OIIO::ColorConfig config;
    if (config.has_error()) throw Failure{OIIO_UNSUPPORTED, shim::or_else(config.geterror(), "no configuration")};
    const std::string on = or_default(display, config.getDefaultDisplayName());
    const std::string by = or_default(view, config.getDefaultViewName(on));
    const auto processor = config.createDisplayTransform(on, by, input, looks);
    if (!processor) {
      throw Failure{OIIO_UNSUPPORTED, shim::or_else(config.geterror(), "there is no such transform")};
    }
    for (uint64_t done = 0; done < count / 3;) {
      const int width = int(std::min(count / 3 - done, kPixelsAtOnce));
      OIIO::ImageBuf some(OIIO::ImageSpec(width, 1, 3, OIIO::TypeDesc::FLOAT), pixels + 3 * done);
      if (!OIIO::ImageBufAlgo::colorconvert(some, some, processor.get(), false)) {
        throw Failure{OIIO_EXCEPTION, shim::or_else(some.geterror(), "the transform failed")};
      }
      done += uint64_t(width);
    }
    shim::copy_message((on + "\n" + by).c_str(), chosen, chosen_size);
  });
}
