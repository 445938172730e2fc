/* Preprocessed, never compiled: build.rs reads the numbers after EMBREE_FOUND.
   Family 4 takes precedence over family 3. */
#if __has_include(<embree4/rtcore_config.h>)
#include <embree4/rtcore_config.h>
#define FAMILY 4
#elif __has_include(<embree3/rtcore_config.h>)
#include <embree3/rtcore_config.h>
#define FAMILY 3
#endif

#if defined(RTC_GEOMETRY_INSTANCE_ARRAY)
#define INSTANCE_ARRAY 1
#else
#define INSTANCE_ARRAY 0
#endif

#if defined(FAMILY)
EMBREE_FOUND FAMILY RTC_VERSION_MAJOR RTC_VERSION_MINOR RTC_VERSION_PATCH INSTANCE_ARRAY
#endif
