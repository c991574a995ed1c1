/* The log: one line of JSON or plain text per message, on standard error, each in one write(). Any thread. */
#ifndef ORB_LOG_H
#define ORB_LOG_H

#include "api/text.h"

typedef enum log_level { LOG_DEBUG, LOG_INFO, LOG_WARN, LOG_ERROR } log_level;

void log_setup(log_level least, int json);
int log_wants(log_level level);
/* fields: further JSON members without braces ("\"job\":\"…\""), or NULL. */
void log_write(log_level level, const char *fields, const char *format, ...) API_PRINTF(3, 4);

#define log_info(...) log_write(LOG_INFO, NULL, __VA_ARGS__)
#define log_warn(...) log_write(LOG_WARN, NULL, __VA_ARGS__)
#define log_error(...) log_write(LOG_ERROR, NULL, __VA_ARGS__)

#endif
