/* All of liborbmorph. */
#ifndef ORBMORPH_ORBMORPH_H
#define ORBMORPH_ORBMORPH_H

#include "orbmorph/align.h"
#include "orbmorph/alignment.h"
#include "orbmorph/asset.h"
#include "orbmorph/carry.h"
#include "orbmorph/context.h"
#include "orbmorph/embed.h"
#include "orbmorph/format.h"
#include "orbmorph/formats.h"
#include "orbmorph/kept.h"
#include "orbmorph/locate.h"
#include "orbmorph/material.h"
#include "orbmorph/material_members.h"
#include "orbmorph/merge.h"
#include "orbmorph/mesh.h"
#include "orbmorph/profile.h"
#include "orbmorph/remesh.h"
#include "orbmorph/remesh_methods.h"
#include "orbmorph/status.h"
#include "orbmorph/transfer.h"
#include "orbmorph/utf8.h"
#include "orbmorph/version.h"

#endif
