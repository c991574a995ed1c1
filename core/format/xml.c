#include "format/xml.h"

#include <expat.h>

#include "base/check.h"
#include "base/hash.h"
#include "base/memory.h"
#include "format/build.h"

struct orb_xml {
  orb_context *ctx;
  orb_xml_element element;
  void *user;
  XML_Parser parser;
  orb_status status; /* of what stopped the parser */
  int depth;
  int64_t given;
};

/* Expat passes no argument to its allocator, so this says whose budget the present call of Expat uses. */
static _Thread_local orb_context *payer;

static orb_context *pay(orb_context *ctx) {
  orb_context *before = payer;
  payer = ctx;
  return before;
}

static void *xml_malloc(size_t size) {
  return orb_alloc(payer, 1, size);
}

static void *xml_realloc(void *block, size_t size) {
  return orb_realloc(payer, block, 1, size);
}

static void xml_free(void *block) {
  orb_free(payer, block);
}

static orb_status refuse_token(const orb_xml *xml) {
  return orb_build_malformed(xml->ctx, 1, orb_xml_line(xml), "A tag or comment of the XML has more than %d bytes.",
                             ORB_XML_TOKEN);
}

static void stop(orb_xml *xml, orb_status status) {
  if (status != ORB_OK && xml->status == ORB_OK) {
    xml->status = status;
    (void)XML_StopParser(xml->parser, XML_FALSE);
  }
}

/* Refuses a token that is longer than ORB_XML_TOKEN, once it is complete. Returns 0 if the parser has been stopped. */
static int measure(orb_xml *xml) {
  if (xml->status == ORB_OK && XML_GetCurrentByteCount(xml->parser) > ORB_XML_TOKEN) {
    stop(xml, refuse_token(xml));
  }
  return xml->status == ORB_OK;
}

static void on_comment(void *user, const XML_Char *text) {
  (void)text;
  (void)measure(user);
}

static void on_instruction(void *user, const XML_Char *target, const XML_Char *text) {
  (void)target, (void)text;
  (void)measure(user);
}

static void on_start(void *user, const XML_Char *name, const XML_Char **attributes) {
  orb_xml *xml = user;
  if (!measure(xml)) {
    return;
  }
  stop(xml, xml->depth < ORB_XML_DEPTH ? xml->element(xml->user, name, attributes, xml->depth)
                                       : orb_build_malformed(xml->ctx, 1, orb_xml_line(xml),
                                                             "The XML nests deeper than %d elements.", ORB_XML_DEPTH));
  xml->depth++;
}

static void on_end(void *user, const XML_Char *name) {
  orb_xml *xml = user;
  xml->depth--;
  if (measure(xml)) {
    stop(xml, xml->element(xml->user, name, NULL, xml->depth));
  }
}

static void on_doctype(void *user, const XML_Char *name, const XML_Char *system, const XML_Char *public, int internal) {
  orb_xml *xml = user;
  (void)name, (void)system, (void)public, (void)internal;
  stop(xml, orb_build_malformed(xml->ctx, 1, orb_xml_line(xml),
                                "The XML has a document type, which the reader refuses; remove it."));
}

orb_status orb_xml_begin(orb_context *ctx, orb_xml_element element, void *user, orb_xml **out) {
  static const XML_Memory_Handling_Suite memory = {xml_malloc, xml_realloc, xml_free};
  orb_xml *xml = ORB_NEW0(ctx, orb_xml, 1);
  if (!xml) {
    return ORB_E_NO_MEMORY;
  }
  *xml = (orb_xml){.ctx = ctx, .element = element, .user = user};
  orb_context *before = pay(ctx);
  xml->parser = XML_ParserCreate_MM(NULL, &memory, "|");
  pay(before);
  if (!xml->parser) {
    orb_free(ctx, xml);
    return ORB_E_NO_MEMORY;
  }
  /* a key of the context: Expat would ask the system for one */
  (void)XML_SetHashSalt(xml->parser, (unsigned long)orb_hash(ctx, "xml", 3) | 1);
  XML_SetUserData(xml->parser, xml);
  XML_SetElementHandler(xml->parser, on_start, on_end);
  XML_SetCommentHandler(xml->parser, on_comment);
  XML_SetProcessingInstructionHandler(xml->parser, on_instruction);
  XML_SetStartDoctypeDeclHandler(xml->parser, on_doctype);
  *out = xml;
  return ORB_OK;
}

orb_status orb_xml_parse(orb_xml *xml, const unsigned char *bytes, size_t size, int is_last) {
  /* Expat keeps an unfinished token and reads it again with what follows: pieces of this size bound that. */
  do {
    size_t piece = size < ORB_XML_TOKEN ? size : ORB_XML_TOKEN;
    orb_context *before = pay(xml->ctx);
    enum XML_Status parsed = XML_Parse(xml->parser, (const char *)bytes, (int)piece, is_last && piece == size);
    pay(before);
    if (xml->status != ORB_OK) {
      return xml->status;
    }
    if (parsed != XML_STATUS_OK) {
      enum XML_Error error = XML_GetErrorCode(xml->parser);
      return error == XML_ERROR_NO_MEMORY
                 ? ORB_E_NO_MEMORY
                 : orb_build_malformed(xml->ctx, 1, orb_xml_line(xml), "The XML is not well-formed: %s.",
                                       XML_ErrorString(error));
    }
    xml->given += (int64_t)piece;
    bytes += piece;
    size -= piece;
    /* The index is that of the last complete token, so an unfinished one behind it is longer than ORB_XML_TOKEN. */
    if (xml->given - XML_GetCurrentByteIndex(xml->parser) > 2 * ORB_XML_TOKEN) {
      return refuse_token(xml);
    }
  } while (size > 0);
  return ORB_OK;
}

int64_t orb_xml_line(const orb_xml *xml) {
  return (int64_t)XML_GetCurrentLineNumber(xml->parser);
}

void orb_xml_end(orb_xml *xml) {
  if (xml) {
    orb_context *before = pay(xml->ctx);
    XML_ParserFree(xml->parser);
    pay(before);
    orb_free(xml->ctx, xml);
  }
}
