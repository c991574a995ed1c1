/* Invariants, which every build checks, and the two ways out of a failed call. */
#ifndef ORB_BASE_CHECK_H
#define ORB_BASE_CHECK_H

#include <stddef.h>

/* Prints the broken invariant and where it is, and ends the process: for bugs, never for bad input. */
_Noreturn void orb_assert_failed(const char *expression, const char *file, int line);
#define ORB_ASSERT(expression) ((expression) ? (void)0 : orb_assert_failed(#expression, __FILE__, __LINE__))

/* Returns the status of a failed call; only where nothing has to be freed. */
#define ORB_TRY(call)                   \
  do {                                  \
    orb_status orb_try_status = (call); \
    if (orb_try_status != ORB_OK) {     \
      return orb_try_status;            \
    }                                   \
  } while (0)

/* Runs a call and jumps to `label` (the one exit path) when it fails; `status` is the function's variable. */
#define ORB_GO(status, call, label) \
  do {                              \
    (status) = (call);              \
    if ((status) != ORB_OK) {       \
      goto label;                   \
    }                               \
  } while (0)

#endif
