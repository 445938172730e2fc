/* C interface to the part of OpenImageIO used by Lumiris: read any image as bytes or 32-bit floats, write
   images of one or several parts.

   Rules for all functions:
   - No C++ exception leaves them. The result is an OiioResult. If it is not OIIO_OK and `error` is not
     null, a message that ends in a zero byte is written to error[0 .. error_size].
   - Paths and names are UTF-8 with a final zero byte. Returned strings belong to the handle and are valid
     until it is closed; strings from functions without a handle are valid forever.
   - A handle is used by one thread at a time. Different handles are independent.

   src/types.rs and src/load.rs declare the same in Rust. A change here must change OIIO_SHIM_ABI in both. */
#ifndef LUMIRIS_OIIO_SHIM_H
#define LUMIRIS_OIIO_SHIM_H

#include <stddef.h>
#include <stdint.h>

#define OIIO_SHIM_ABI 4

#if defined(_WIN32)
#define OIIO_SHIM_API __declspec(dllexport)
#else
#define OIIO_SHIM_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

enum OiioResult {
  OIIO_OK = 0,
  OIIO_INVALID_ARGUMENT = 1, /* the caller's fault: null pointer, wrong index, wrong length */
  OIIO_CANNOT_OPEN = 2,      /* missing, unreadable, not an image, or the header is broken */
  OIIO_UNSUPPORTED = 3,      /* deep or volume data; a format that cannot hold the requested data */
  OIIO_TOO_LARGE = 4,        /* the header asks for more memory than the caller allows */
  OIIO_CANNOT_READ = 5,      /* the pixels are damaged or missing */
  OIIO_CANNOT_WRITE = 6,     /* disk full, no permission, encoder failed */
  OIIO_OUT_OF_MEMORY = 7,
  OIIO_EXCEPTION = 8         /* any other C++ exception */
};

/* Type of a channel in a file. */
enum OiioFormat {
  OIIO_FORMAT_UNKNOWN = 0,
  OIIO_FORMAT_U8 = 1,
  OIIO_FORMAT_U16 = 2,
  OIIO_FORMAT_U32 = 3,
  OIIO_FORMAT_HALF = 4,
  OIIO_FORMAT_FLOAT = 5,
  OIIO_FORMAT_DOUBLE = 6,
  OIIO_FORMAT_I8 = 7,
  OIIO_FORMAT_I16 = 8,
  OIIO_FORMAT_I32 = 9
};

typedef struct OiioInput OiioInput;
typedef struct OiioOutput OiioOutput;

/* Header of a subimage. Not checked: a damaged file may contain any values. */
typedef struct OiioSpec {
  int32_t width, height, depth; /* data window, pixels; depth is 1 for images */
  int32_t x, y;                 /* data window, first pixel */
  int32_t full_x, full_y, full_width, full_height; /* display window */
  int32_t nchannels;
  int32_t format;        /* OiioFormat; the widest if the channels differ */
  int32_t alpha_channel; /* index or -1 */
  int32_t deep;          /* 1: several samples per pixel; such pixels cannot be read here */
  int32_t attributes;    /* number of metadata entries */
} OiioSpec;

/* One level of the pyramid of a subimage. */
typedef struct OiioLevel {
  int32_t width, height;           /* pixels */
  int32_t tile_width, tile_height; /* pixels; 0: stored in rows */
} OiioLevel;

/* One metadata entry. */
typedef struct OiioAttribute {
  const char* name;
  const char* type;  /* OpenImageIO's name: "string", "int", "float", "float[3]", "matrix", ... */
  const char* value; /* as text; a string without quotes */
  const void* data;  /* raw values of the type, or null if the type holds strings */
  size_t bytes;      /* length of data */
} OiioAttribute;

/* One part (subimage) of a file to write. */
typedef struct OiioPart {
  const char* name;        /* part name, or null */
  const char* compression; /* for instance "zip", "piz", "dwaa:45", "jpeg:90", or null */
  int32_t width, height;
  int32_t x, y;                                    /* data window, first pixel */
  int32_t full_x, full_y, full_width, full_height; /* display window; full_width 0: the data window */
  int32_t nchannels;
  const char* const* channel_names; /* nchannels names */
  const int32_t* channel_formats;   /* nchannels OiioFormat */
} OiioPart;

/* ---- library ---- */

/* OIIO_SHIM_ABI of the loaded shim. */
OIIO_SHIM_API int32_t oiio_shim_abi(void);
/* Version of the loaded OpenImageIO library, for instance "2.4.7". */
OIIO_SHIM_API const char* oiio_shim_version(void);
/* Formats with their extensions: "openexr:exr,sxr,mxr;png:png;...". */
OIIO_SHIM_API const char* oiio_shim_extensions(void);
/* Sets a global attribute: "threads", "exr_threads", "limits:imagesize_MB", "limits:channels". */
OIIO_SHIM_API int32_t oiio_shim_set_int(const char* name, int32_t value, char* error, size_t error_size);

/* ---- colour ---- */

/* Converts `count` floats, RGB triples of the colour space `input`, to display colours with the OpenColorIO
   configuration named by $OCIO. Empty `display` and `view` mean the configuration's defaults, empty `looks` the
   view's looks. `chosen` receives "display\nview". OIIO_UNSUPPORTED if the configuration cannot be read or has no
   such names, or if OpenImageIO was built without OpenColorIO; the pixels are then undefined. */
OIIO_SHIM_API int32_t oiio_shim_ocio_display(const char* input, const char* display, const char* view,
                                             const char* looks, float* pixels, uint64_t count, char* chosen,
                                             size_t chosen_size, char* error, size_t error_size);

/* ---- reading ---- */

/* Opens a file. unassociated_alpha 1: colours as stored, not multiplied by alpha. */
OIIO_SHIM_API int32_t oiio_shim_input_open(const char* path, int32_t unassociated_alpha, OiioInput** input,
                                           char* error, size_t error_size);
/* Name of the file format: "openexr", "png", ... */
OIIO_SHIM_API const char* oiio_shim_input_format_name(OiioInput* input);
/* Number of subimages, at least 1. */
OIIO_SHIM_API int32_t oiio_shim_input_subimages(OiioInput* input, int32_t* count, char* error, size_t error_size);
/* Header of a subimage. */
OIIO_SHIM_API int32_t oiio_shim_input_spec(OiioInput* input, int32_t subimage, OiioSpec* spec, char* error,
                                           size_t error_size);
/* Name and OiioFormat of a channel. Channels are in the file's order, which may differ from the order of
   writing: find them by name. */
OIIO_SHIM_API int32_t oiio_shim_input_channel(OiioInput* input, int32_t subimage, int32_t channel,
                                              const char** name, int32_t* format, char* error, size_t error_size);
/* Metadata entry of a subimage, 0 <= index < spec.attributes. */
OIIO_SHIM_API int32_t oiio_shim_input_attribute(OiioInput* input, int32_t subimage, int32_t index,
                                                OiioAttribute* attribute, char* error, size_t error_size);
/* Number of values of a subimage: width * height * nchannels. OIIO_TOO_LARGE if they take more than max_bytes as
   floats, OIIO_UNSUPPORTED if the subimage is deep, a volume, or empty. */
OIIO_SHIM_API int32_t oiio_shim_input_value_count(OiioInput* input, int32_t subimage, uint64_t max_bytes,
                                                  uint64_t* count, char* error, size_t error_size);
/* Level of a subimage; level 0 is the image itself. OIIO_UNSUPPORTED if the file has no such level, or if it is
   deep, a volume, or empty. */
OIIO_SHIM_API int32_t oiio_shim_input_level(OiioInput* input, int32_t subimage, int32_t level, OiioLevel* out,
                                            char* error, size_t error_size);
/* Reads `width` x `height` pixels of a level from column x and row y on, counted from the level's top left. The
   level must contain them. Channels are [channel_begin, channel_end), interleaved, top row first. `format` is the type
   of the `values`, OIIO_FORMAT_U8 or OIIO_FORMAT_FLOAT, and `count` is width * height * (channel_end -
   channel_begin). After an error the values are undefined, but remain initialised. */
OIIO_SHIM_API int32_t oiio_shim_input_read_region(OiioInput* input, int32_t subimage, int32_t level, int32_t x,
                                                  int32_t y, int32_t width, int32_t height, int32_t channel_begin,
                                                  int32_t channel_end, int32_t format, void* values, uint64_t count,
                                                  char* error, size_t error_size);
/* Closes and frees. Null is allowed. */
OIIO_SHIM_API void oiio_shim_input_close(OiioInput* input);

/* ---- writing: create, add parts, attributes, open, write each part in order, close, free ---- */

/* Chooses the encoder by the extension of the path. No file is created yet. */
OIIO_SHIM_API int32_t oiio_shim_output_create(const char* path, OiioOutput** output, char* error,
                                              size_t error_size);
/* Adds a part; parts are numbered from 0. Only OpenEXR files hold more than one. */
OIIO_SHIM_API int32_t oiio_shim_output_add_part(OiioOutput* output, const OiioPart* part, char* error,
                                                size_t error_size);
/* Metadata of a part. The matrix is 16 floats, in the order of OpenImageIO (row vectors). */
OIIO_SHIM_API int32_t oiio_shim_output_set_string(OiioOutput* output, int32_t part, const char* name,
                                                  const char* value, char* error, size_t error_size);
OIIO_SHIM_API int32_t oiio_shim_output_set_int(OiioOutput* output, int32_t part, const char* name, int32_t value,
                                               char* error, size_t error_size);
OIIO_SHIM_API int32_t oiio_shim_output_set_float(OiioOutput* output, int32_t part, const char* name, float value,
                                                 char* error, size_t error_size);
OIIO_SHIM_API int32_t oiio_shim_output_set_matrix(OiioOutput* output, int32_t part, const char* name,
                                                  const float* value, char* error, size_t error_size);
/* Creates the file and writes its header. */
OIIO_SHIM_API int32_t oiio_shim_output_open(OiioOutput* output, char* error, size_t error_size);
/* Writes rows [row_begin, row_begin + rows) of the current part (row 0 is the top) from
   rows * width * nchannels interleaved floats in the order of channel_names. Rows must be written in order
   and without gaps. After the last row of a part, the next call writes part + 1. */
OIIO_SHIM_API int32_t oiio_shim_output_write(OiioOutput* output, int32_t part, int32_t row_begin, int32_t rows,
                                             const float* pixels, uint64_t count, char* error, size_t error_size);
/* Ends the file. Reports everything that could not be stored, including a full disk. */
OIIO_SHIM_API int32_t oiio_shim_output_close(OiioOutput* output, char* error, size_t error_size);
/* Frees the handle. Without a close before, the file is incomplete. Null is allowed. */
OIIO_SHIM_API void oiio_shim_output_free(OiioOutput* output);

#ifdef __cplusplus
}
#endif
#endif
