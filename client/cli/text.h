/* Memory, text, numbers, files and JSON members. */
#ifndef ORB_CLI_TEXT_H
#define ORB_CLI_TEXT_H

#include <cjson/cJSON.h>
#include <stddef.h>

/* These never return NULL: without memory the program ends. The caller frees what they return. */
void *cli_alloc(size_t size); /* zeroed */
char *cli_text(const char *format, ...) __attribute__((format(printf, 1, 2)));
char *cli_escape(const char *text);    /* percent-encoded for a query */
char *cli_base_name(const char *path); /* the file name without folder and extension */

/* The bytes of a file and a final zero; NULL after printing the error. */
char *cli_read_file(const char *path, size_t *size);

int cli_is_id(const char *text); /* 64 hexadecimal digits */
const char *cli_string(const cJSON *object, const char *name, const char *otherwise);
double cli_number(const cJSON *object, const char *name); /* NaN if the member is missing */
void cli_count(double value, char out[32]);               /* 12345 → 12,345 */

/* Rounded down to hundredths: 0.4966 is printed as 0.49, not as the limit 0.50 that it misses. */
double cli_hundredths(double value);

/* Parse the whole text; 0 if it is not a number, or not in the range. */
int cli_whole_number(const char *text, long least, long most, long *out);
int cli_decimal(const char *text, double *out);
int cli_fraction(const char *text, double *out); /* "0.05" or "5%" */

#endif
