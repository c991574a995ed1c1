/* Where objects are in S3: s3://BUCKET[/PREFIX]?endpoint=URL&region=R[&path_style=1][&part_mib=N].
 *
 * A bucket and a prefix may consist only of characters that S3's signatures encode as themselves. So there is one way
 * only to encode a path.
 */
#ifndef ORB_NET_S3_URL_H
#define ORB_NET_S3_URL_H

enum { S3_NAME = 64, S3_PREFIX = 256, S3_HOST = 320 };
enum { S3_PART_LEAST = 5, S3_PART_MOST = 5120 }; /* MiB of a part, as S3 limits it */

typedef struct s3_place {
  char bucket[S3_NAME], region[S3_NAME];
  char prefix[S3_PREFIX]; /* "" or with a slash at its end */
  char scheme[8];         /* http or https */
  char host[S3_HOST];     /* of requests, with the port unless it is the scheme's own; has the bucket or not */
  char base[S3_NAME + 2]; /* the path before a key: "/" or "/BUCKET/" */
  int part_mib;           /* objects that are larger are sent in parts of this many MiB */
} s3_place;

/* 0: *why says what is wrong, as the end of a sentence. */
int s3_url_read(const char *text, s3_place *out, const char **why);

#endif
