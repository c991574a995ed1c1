/* Status codes: the result type of every function that can fail.
 *
 * The compiler warns where a caller ignores one. ORB_OK is 0. The context holds the error: a sentence and the facts
 * (line, edges, genus, …), see orb_context_error().
 */
#ifndef ORBMORPH_STATUS_H
#define ORBMORPH_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

/* Marks the functions of the library; the shared library exports no others. A program that links the static library on
 * Windows defines ORB_STATIC. ORB_BUILD is defined while the library itself is compiled. */
#if defined(_WIN32)
#if defined(ORB_STATIC)
#define ORB_API
#elif defined(ORB_BUILD)
#define ORB_API __declspec(dllexport)
#else
#define ORB_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define ORB_API __attribute__((visibility("default")))
#else
#define ORB_API
#endif

#if defined(__GNUC__)
#define ORB_MUST_CHECK __attribute__((warn_unused_result))
#else
#define ORB_MUST_CHECK
#endif

/* The version of the algorithms; part of the key of each derived object. */
#define ORB_ENGINE "orbmorph 1.0.0-38"

typedef enum orb_status {
  ORB_OK = 0,
  /* The bytes. */
  ORB_E_UNKNOWN_FORMAT, /* no reader knows these bytes */
  ORB_E_MALFORMED_MESH, /* a reader knows them but they are not valid; the error has a line or an offset */
  ORB_E_TOO_LARGE,      /* beyond a limit of the context or of an index type */
  /* The surface. */
  ORB_E_NOT_FINITE,     /* NaN or infinite coordinate, or one too large */
  ORB_E_NOT_CLOSED,     /* boundary edges */
  ORB_E_NOT_MANIFOLD,   /* an edge with more than two faces, or a vertex with more than one fan */
  ORB_E_NOT_ORIENTABLE, /* no consistent orientation exists (or, without repairs, none is given) */
  ORB_E_NOT_CONNECTED,  /* several pieces */
  ORB_E_NOT_GENUS_ZERO, /* handles */
  ORB_E_DEGENERATE,     /* fewer than four triangles left, or a size or position that float32 cannot hold */
  /* The request. */
  ORB_E_BAD_LANDMARKS, /* contradictory, crossed or out of range; the error names them */
  ORB_E_BAD_OPTION,    /* an option outside its range */
  ORB_E_UNSUPPORTED,   /* a method that this build does not have */
  /* The run. */
  ORB_E_NO_MEMORY,     /* the budget of the context or the memory of the machine is spent */
  ORB_E_CANCELLED,     /* orb_context_cancel() was called */
  ORB_E_TIMEOUT,       /* the deadline of the context has passed */
  ORB_E_NOT_CERTIFIED, /* a result was computed but its certificate does not hold; it is not returned */
  ORB_E_CORRUPT,       /* stored bytes do not decode */
  ORB_E_INTERNAL,      /* a bug */
  ORB_STATUS_COUNT
} orb_status;

/* The name of a status on the wire, such as "not-closed"; never NULL. */
ORB_API const char *orb_status_name(orb_status status);

#ifdef __cplusplus
}
#endif
#endif
