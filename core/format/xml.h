/* XML by Expat, under the budget and the limits of a reader: elements with their attributes, in order. Names are
 * "NAMESPACE|name", or "name" without a namespace. A document type is refused, so no entity expands; elements nest at
 * most ORB_XML_DEPTH deep. A tag, comment or instruction has at most ORB_XML_TOKEN bytes. */
#ifndef ORB_FORMAT_XML_H
#define ORB_FORMAT_XML_H

#include "orbmorph/context.h"

enum { ORB_XML_DEPTH = 64, ORB_XML_TOKEN = 1 << 16 };

typedef struct orb_xml orb_xml;

/* A start tag, or with attributes NULL an end tag. attributes: alternating names and values, then NULL. depth: 0 for
 * the root. */
typedef orb_status (*orb_xml_element)(void *user, const char *name, const char **attributes, int depth);

ORB_MUST_CHECK orb_status orb_xml_begin(orb_context *ctx, orb_xml_element element, void *user, orb_xml **out);

/* Parses the next bytes of the document. O(size), and at most ORB_XML_TOKEN more. */
ORB_MUST_CHECK orb_status orb_xml_parse(orb_xml *xml, const unsigned char *bytes, size_t size, int is_last);

/* The line that the parser is in, from 1. */
int64_t orb_xml_line(const orb_xml *xml);

void orb_xml_end(orb_xml *xml); /* NULL is fine */

#endif
