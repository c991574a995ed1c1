/* Reports that several resources and the bench share: certificate, distortion, shapes. */
#ifndef ORB_API_REPORT_CODEC_H
#define ORB_API_REPORT_CODEC_H

#include "api/text.h"
#include "orbmorph/embed.h"
#include "orbmorph/transfer.h"

/* Each appends one JSON value. */
void api_certificate_write(api_text *out, const orb_certificate *certificate);
void api_distortion_write(api_text *out, const orb_distortion *distortion);
/* The members of one shape's report, into an object that is already open. */
void api_shape_report_members(api_text *out, const orb_shape_report *report);

#endif
