/* Files of other kinds that people have. */
#ifndef ORB_FORMAT_OTHER_H
#define ORB_FORMAT_OTHER_H

#include <stddef.h>

/* Names the kind of a file that no reader takes, with an article and what to do: "an FBX file; export it as glTF". NULL
 * if the first bytes are not a known signature. */
const char *orb_format_other(const unsigned char *bytes, size_t size);

#endif
