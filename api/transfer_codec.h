/* The member "transfer" of a request for a supermesh, and "transferred" of a supermesh. */
#ifndef ORB_API_TRANSFER_CODEC_H
#define ORB_API_TRANSFER_CODEC_H

#include <cjson/cJSON.h>

#include "api/problem.h"
#include "orbmorph/carry.h"

/* Reads the list. out: room for ORB_CARRY_MAX. Returns 1, or 0 with *problem filled. */
int api_transfer_read(const cJSON *list, int32_t shape_count, orb_carry *out, int32_t *count, api_problem *problem);

/* Converts a list of a URL, such as "1:skin,2:texture:2048", to the member "transfer". Words in place of numbers stay
 * strings, which api_transfer_read() refuses. NULL: out of memory. */
cJSON *api_transfer_parse(const char *list);

/* Appends the list in its canonical form. */
void api_transfer_write(const orb_carry *carries, int32_t count, api_text *out);

/* Appends the value of "transferred". */
void api_transferred_write(const orb_carried *carried, int32_t count, api_text *out);

#endif
