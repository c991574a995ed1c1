/* Frames between the daemon and a process that reads a mesh or runs a job.
 *
 * A frame is a head of 16 bytes, then its payload; a descriptor travels with the head. Both ends are the same program
 * on the same machine, so numbers are as the machine has them, but the daemon trusts nothing that it receives: sizes
 * are bounded before memory is taken, and texts are ended.
 */
#ifndef ORB_ISOLATE_CHANNEL_H
#define ORB_ISOLATE_CHANNEL_H

#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

enum { CHANNEL_VERSION = 1, CHANNEL_MOST = 64 << 20, CHANNEL_PARTS = 3 };
/* The daemon takes no larger frame from a process: objects come as descriptors. The largest descriptions and refusals
 * have 3 to 4 MB. */
enum { CHANNEL_ANSWER_MOST = 16 << 20 };

typedef enum frame_type {
  FRAME_TASK = 1, /* to the process: what to do, and its limits */
  FRAME_INPUT,    /* to the process: a row, with the descriptor of its object */
  FRAME_GO,       /* to the process: all inputs are sent */
  FRAME_PROGRESS, /* from the process */
  FRAME_OBJECT,   /* from the process: an object, as a descriptor of memory */
  FRAME_DONE,     /* from the process: the result or the problem */
  FRAME_TYPES
} frame_type;

typedef struct frame {
  frame_type type;
  int fd;               /* −1: none */
  unsigned char *bytes; /* of malloc(); a zero byte follows the last one */
  size_t size;
} frame;

/* Called while the other end lets this one wait, at least every CHANNEL_LOOK_MS: 0 gives up. What has arrived is
 * received without asking, since it may be the last that was waited for. But another end that sends without a pause
 * never lets this one wait, so it is called, too, before each part of a frame after the first CHANNEL_UNASKED: the
 * largest answer, of 4 MB, has 20 parts or more, as a socket holds some 200 KB. NULL: never. */
enum { CHANNEL_LOOK_MS = 20, CHANNEL_UNASKED = 64 };
typedef int (*channel_continues)(void *user);

/* Closed: by the other end. Failed: this end has no memory for the frame. Bad: what arrived is no frame, or a larger
 * one than allowed. */
typedef enum channel_result { CHANNEL_OK, CHANNEL_CLOSED, CHANNEL_FAILED, CHANNEL_STOPPED, CHANNEL_BAD } channel_result;

/* Sends the parts as one payload, and a copy of the descriptor unless it is −1. */
channel_result channel_send(int fd, frame_type type, const struct iovec *parts, int count, int passed,
                            channel_continues continues, void *user);
/* The caller calls frame_free(). most: of the payload. */
channel_result channel_receive(int fd, size_t most, frame *out, channel_continues continues, void *user);
void frame_free(frame *f);

#endif
