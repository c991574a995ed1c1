/* ORB_CLONES before a function compiles it for several vector widths, of which the loader chooses one. For loops whose
 * results do not depend on the width. The function's name must be unique in the library, even where it is static: the
 * resolvers that clang makes are global. */
#ifndef ORB_NUMERIC_CLONES_H
#define ORB_NUMERIC_CLONES_H

/* Not with sanitizers: the loader chooses before their runtime is initialised. */
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
#define ORB_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define ORB_SANITIZED 1
#endif
#endif

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(ORB_SANITIZED)
#define ORB_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define ORB_CLONES
#endif

#endif
