/* The contents of the frames of channel.h. Both sides write a zero byte at the end of each text in these structs. */
#ifndef ORB_ISOLATE_TASK_H
#define ORB_ISOLATE_TASK_H

#include "api/mesh_codec.h"
#include "api/problem.h"
#include "isolate/isolate.h"
#include "orbmorph/profile.h"
#include "store/catalogue.h"
#include "store/objects.h"

typedef enum task_kind { TASK_CHECK, TASK_EMBEDDING, TASK_SUPERMESH, TASK_PROFILE } task_kind;

/* FRAME_TASK. For a job, its request follows, then FRAME_INPUT for each input and FRAME_GO. For a check, the file
 * follows, or its descriptor comes with the frame. For a profile, the descriptor of the asset comes with it. */
typedef struct task_head {
  task_kind kind;
  int threads, nice;
  int bucket;            /* whether objects go to a bucket */
  int again;             /* the process waits for another check after this one; the next three limit all of them */
  int64_t limit, inputs; /* bytes that the process may take, and of all inputs together */
  int64_t cpu_seconds;
  int64_t memory;      /* bytes: the budget of this task */
  int64_t deadline_ms; /* orb_clock_ms() */
  int64_t max_triangles;
  char key[API_ID_SIZE]; /* of the job or the profile, or the id of the mesh to check */
  double embed_ms;
  char name[ORB_NAME_MAX], repair[API_REPAIR_TEXT]; /* of the mesh to check, as the three below */
  orb_repair_options options;
  orb_format format;
  orb_profile profile; /* of the asset to convert */
  int64_t bytes, created;
} task_head;

/* FRAME_INPUT, with the descriptor of the object; the row's description follows. */
typedef struct input_head {
  resource_kind row;
  object_kind object;
  char id[API_ID_SIZE], sha[API_ID_SIZE]; /* sha: of the object, by its row */
} input_head;

/* FRAME_PROGRESS. */
typedef struct progress_head {
  char stage[24];
  double fraction;
} progress_head;

/* FRAME_OBJECT, with the descriptor of the file that has the object. */
typedef struct object_head {
  object_kind kind;
  int64_t start, size; /* in bytes */
  char id[API_ID_SIZE];
} object_head;

/* FRAME_DONE; the description of the result or the facts of the problem follow. */
typedef struct done_head {
  int fine, gone;
  int lacks; /* which of SANDBOX_ALL do not hold in the process */
  int64_t flips, bytes, created;
  char sha[API_ID_SIZE], places[API_ID_SIZE];
  char problem[40], detail[512];
} done_head;

/* The process's side. Confines the calling process to the limits of the task. With isolate = strict, a process that
 * cannot be confined sends the problem and ends: it has only looked at the numbers of the task, which the daemon wrote.
 * Returns the only file in memory that it can write to, for its results; −1: none, as for a check. A single file, since
 * the kernel limits each by itself. */
int task_confine(int channel, const task_head *task);
/* Sends FRAME_OBJECT, with a descriptor of that file. */
channel_result task_send_object(int channel, int results, object_kind kind, const char *id, int64_t start,
                                int64_t size);
/* Sends FRAME_DONE. json, problem: may be NULL. */
channel_result task_answer(int channel, done_head *done, const char *json, const api_problem *problem);
/* The same, then ends the process. */
_Noreturn void task_end(int channel, done_head *done, const char *json, const api_problem *problem);

/* The daemon's side. Reads FRAME_OBJECT; 0: it is none. */
int task_read_object(const frame *f, object_head *head);
/* Frees the memory of an object that the daemon has copied: else all results of a process are in memory until it ends.
 * What the process passed is its own file, as it gets all others for reading only. */
void task_free_object(const frame *f, const object_head *head);
/* Reads FRAME_DONE, and logs what the process lacks: json is allocated with malloc(), or NULL. The caller checks it
 * with task_is_object(). 0: the result contradicts itself. */
int task_read_done(const frame *f, done_head *done, char **json, api_problem *problem);
/* Whether a text that a process wrote is a JSON object, with no more values than any description or refusal. */
int task_is_object(const char *text);
/* Refuses work for which isolate_open() got no process; returns 0. */
int task_refuse_open(const isolated *p, api_problem *problem);
/* Refuses what the store could not do; returns 0. */
int task_refuse_store(store_result result, api_problem *problem);
/* A limit on the processor time of a job with this many threads until its deadline. */
int64_t task_cpu_seconds(int64_t deadline_ms, int threads);

#endif
