// Error handling shared by the files of the shim: errors do not cross the boundary.
#ifndef LUMIRIS_OIIO_COMMON_H
#define LUMIRIS_OIIO_COMMON_H

#include "oiio_shim.h"

#include <OpenImageIO/imageio.h>

#include <cstring>
#include <new>
#include <string>

#if OIIO_VERSION < 20400 || OIIO_VERSION >= 40000
#error "OpenImageIO 2.4 to 3.x is needed"
#endif

namespace shim {

// Thrown inside the shim only; guard() converts it to a code and a message.
struct Failure {
  OiioResult code;
  std::string message;
};

inline void copy_message(const char* message, char* error, size_t error_size) {
  if (error == nullptr || error_size == 0) return;
  size_t length = std::strlen(message);
  if (length >= error_size) length = error_size - 1;
  std::memcpy(error, message, length);
  error[length] = '\0';
}

// Runs `body`. No exception leaves it.
template <typename Body>
int32_t guard(char* error, size_t error_size, Body body) noexcept {
  try {
    body();
    return OIIO_OK;
  } catch (const Failure& failure) {
    copy_message(failure.message.c_str(), error, error_size);
    return failure.code;
  } catch (const std::bad_alloc&) {
    copy_message("out of memory", error, error_size);
    return OIIO_OUT_OF_MEMORY;
  } catch (const std::exception& exception) {
    copy_message(exception.what(), error, error_size);
    return OIIO_EXCEPTION;
  } catch (...) {
    copy_message("unknown C++ exception", error, error_size);
    return OIIO_EXCEPTION;
  }
}

inline void require(bool condition, const char* what) {
  if (!condition) throw Failure{OIIO_INVALID_ARGUMENT, what};
}

// A message is never empty: OpenImageIO may fail without a message.
inline std::string or_else(std::string message, const char* otherwise) {
  while (!message.empty() && (message.back() == '\n' || message.back() == ' ')) message.pop_back();
  return message.empty() ? std::string(otherwise) : message;
}

}  // namespace shim

#endif
