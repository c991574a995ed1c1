/* Reads JSON within a task. As values, JSON takes up to 56 times the bytes of its text. So a text has a limit on its
 * values, and large texts are read one at a time; the memory then goes back to the system. */
#ifndef ORB_HTTP_READ_JSON_H
#define ORB_HTTP_READ_JSON_H

#include "http/http.h"

/* Of a body with the landmarks that it names: a request with 1,024 landmarks of 16 shapes has fewer. With a name each,
 * so many take 15 MB. */
enum { JSON_VALUES_MOST = 1 << 17 };
/* Smaller texts have too few values to matter. */
enum { JSON_LARGE = 16 << 10 };

/* Parses the body and frees its text; NULL with the problem. json_done() ends it, in the same task. */
cJSON *read_json(request *r, api_problem *problem);
/* Parses another text beside the body; NULL with the problem. */
cJSON *read_json_beside(const char *text, size_t size, api_problem *problem);
/* Frees a body; NULL: does nothing. Others may then read large ones. */
void json_done(cJSON *body);

#endif
