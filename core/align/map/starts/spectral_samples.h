/* Samples that correspond by the vibrations of the surfaces, whatever the pose. */
#ifndef ORB_ALIGN_MAP_STARTS_SPECTRAL_SAMPLES_H
#define ORB_ALIGN_MAP_STARTS_SPECTRAL_SAMPLES_H

#include "align/map/engine/run.h"

/* Fills run->samples from the spectral map that agrees best with the landmarks; leaves them empty where none agrees, or
 * there are too few landmarks to tell. About 0.15 s for shapes of 10,000 triangles. */
ORB_MUST_CHECK orb_status orb_map_spectral_samples(orb_map_run *run);

#endif
