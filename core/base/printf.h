/* Lets the compiler check the arguments of functions that format like printf(). */
#ifndef ORB_BASE_PRINTF_H
#define ORB_BASE_PRINTF_H

/* text, first: the numbers of the format and of its first argument among the parameters, from 1. */
#if defined(__GNUC__)
#define ORB_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define ORB_PRINTF(text, first)
#endif

#endif
