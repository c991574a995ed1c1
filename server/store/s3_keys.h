/* The keys with which requests to S3 are signed. */
#ifndef ORB_STORE_S3_KEYS_H
#define ORB_STORE_S3_KEYS_H

#include "store/s3_sign.h"

/* Reads keys from the variables AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN if path is "", or from a
 * file of lines aws_access_key_id = …, aws_secret_access_key = … and aws_session_token = …, of its section [default] if
 * it has sections. 0: *why says what is wrong. */
int s3_keys_read(const char *path, s3_keys *out, const char **why);

#endif
