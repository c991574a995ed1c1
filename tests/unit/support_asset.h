/* Writes assets of generated supermeshes, and finds their parts. */
#ifndef SUPPORT_ASSET_H
#define SUPPORT_ASSET_H

#include "support_supermesh.h"

extern const char *const asset_names[SYNTHETIC_SHAPES_MAX];

/* For cmocka_unit_test_setup_teardown(): *state points to a context. */
int asset_setup(void **state);
int asset_teardown(void **state);

/* The asset with these names; an error fails the test. The caller frees *out and closes the GLB. */
glb asset_write(orb_context *ctx, const synthetic *made, const orb_asset_options *options, orb_asset_facts *facts,
                orb_buffer *out);
const cJSON *asset_mesh(const glb *file); /* the first one */
const cJSON *asset_primitive(const glb *file, int index);

#endif
