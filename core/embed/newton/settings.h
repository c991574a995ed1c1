/* The constants of the method `newton`, by preset. */
#ifndef ORB_EMBED_NEWTON_SETTINGS_H
#define ORB_EMBED_NEWTON_SETTINGS_H

#include "embed/newton/vector/jobs.h"
#include "orbmorph/embed.h"

enum { ORB_NEWTON_FAR = 8 }; /* a level with fewer than 1/8 of all vertices is far from full resolution */

typedef struct orb_newton_settings {
  double growth, growth_fine; /* of the vertex count from level to level: below fine_from vertices, and from there on */
  int32_t fine_from;
  int32_t coarse_until; /* levels of fewer vertices get coarse_sweeps: they are cheap, and they decide most */
  int32_t coarse_sweeps, level_sweeps, final_sweeps; /* final_sweeps: at full resolution */
  int32_t most_sweeps; /* of one level: sweeps are added while each lowers the energy by more than `converged` of it */
  double converged, converged_last; /* _last: at full resolution */
  double settled, settled_last;     /* a sweep that lowers the energy by less than this share ends the level */
  double settled_far;               /* the same far from full resolution, where sweeps cost next to nothing */
  orb_newton_energy energy;
  double blend;   /* of the shapes of coarse triangles towards equilateral, 0 to 1 */
  double finest;  /* the same at full resolution: keeps degenerate triangles finite, changes no other */
  double crowded; /* energy per area (1: isometric) above which a new star's surroundings are relaxed */
} orb_newton_settings;

void orb_newton_settings_of(const orb_embed_options *options, orb_newton_settings *out);

/* The energy of embeddings that keep angles and let areas go. */
orb_newton_energy orb_newton_energy_of_angles(void);

#endif
