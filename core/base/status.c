#include "orbmorph/status.h"

static const char *const names[ORB_STATUS_COUNT] = {
    [ORB_OK] = "ok",
    [ORB_E_UNKNOWN_FORMAT] = "unknown-format",
    [ORB_E_MALFORMED_MESH] = "malformed-mesh",
    [ORB_E_TOO_LARGE] = "too-large",
    [ORB_E_NOT_FINITE] = "not-finite",
    [ORB_E_NOT_CLOSED] = "not-closed",
    [ORB_E_NOT_MANIFOLD] = "not-manifold",
    [ORB_E_NOT_ORIENTABLE] = "not-orientable",
    [ORB_E_NOT_CONNECTED] = "not-connected",
    [ORB_E_NOT_GENUS_ZERO] = "not-genus-zero",
    [ORB_E_DEGENERATE] = "degenerate",
    [ORB_E_BAD_LANDMARKS] = "bad-landmarks",
    [ORB_E_BAD_OPTION] = "bad-option",
    [ORB_E_UNSUPPORTED] = "unsupported-method",
    [ORB_E_NO_MEMORY] = "no-memory",
    [ORB_E_CANCELLED] = "cancelled",
    [ORB_E_TIMEOUT] = "timeout",
    [ORB_E_NOT_CERTIFIED] = "not-certified",
    [ORB_E_CORRUPT] = "corrupt",
    [ORB_E_INTERNAL] = "internal",
};

const char *orb_status_name(orb_status status) {
  return (unsigned)status < ORB_STATUS_COUNT ? names[status] : "unknown";
}
