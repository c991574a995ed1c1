/* The JSON of certificates, distortion and shape reports, which several resources and the bench share. */
#ifndef ORB_API_REPORT_CODEC_H
#define ORB_API_REPORT_CODEC_H

#include "api/text.h"
#include "orbmorph/embed.h"
#include "orbmorph/transfer.h"

/* Append one JSON value. */
void api_certificate_write(api_text *out, const orb_certificate *certificate);
void api_distortion_write(api_text *out, const orb_distortion *distortion);
/* Appends the members of a shape's report to an object that is already open. */
void api_shape_report_members(api_text *out, const orb_shape_report *report);

#endif
