/* What a function of the public interface carries: only these are visible in the shared libraries. */
#ifndef STROLL_EXPORT_H
#define STROLL_EXPORT_H

#if defined(__GNUC__)
#define STRL_API __attribute__((visibility("default")))
#else
#define STRL_API
#endif

#endif
