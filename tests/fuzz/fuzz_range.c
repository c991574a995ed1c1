/* A Range header: the first 8 bytes are the size of the file, the rest is the header. The served range must be within
 * the file. */
#include <stdlib.h>
#include <string.h>

#include "http/parse.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  uint64_t file, first = 0, length = 0;
  if (size < sizeof file) {
    return 0;
  }
  memcpy(&file, data, sizeof file);
  file >>= 1; /* sizes of files are signed */
  char *text = strndup((const char *)data + sizeof file, size - sizeof file);
  if (!text) {
    return 0;
  }
  int ranged = parse_range(text, file, &first, &length);
  if (ranged < -1 || ranged > 1 || (ranged == 1 && (length == 0 || first >= file || length > file - first))) {
    abort();
  }
  free(text);
  return 0;
}
