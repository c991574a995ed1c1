/* The JSON of a supermesh. */
#ifndef ORB_API_SUPERMESH_CODEC_H
#define ORB_API_SUPERMESH_CODEC_H

#include "api/supermesh_request.h"

/* embed_ms: the time that the embeddings of this job took; 0 if all were stored. found: the found landmarks as a
 * request would name them, found_count × shape_count places; others: likewise those of all alternatives, one after the
 * other; meant: where each suspect would lie. */
void api_supermesh_write(const char *id, const api_supermesh_request *request, const orb_merge_result *result,
                         const api_place *found, api_place *others, const api_place *meant, double embed_ms,
                         int64_t created, api_text *out);
/* Appends the summary of a supermesh: its description without report and request. 0: the description is not valid
 * JSON of a supermesh, and nothing is appended. */
int api_supermesh_summary(const char *description, api_text *out);
/* Append the values of "certificate" and "pairs", which the bench also writes. */
void api_merge_certificate_write(const orb_merge_result *result, api_text *out);
void api_pairs_write(const orb_merge_result *result, api_text *out);
#endif
