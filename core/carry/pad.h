/* Padding of baked pictures. */
#ifndef ORB_CARRY_PAD_H
#define ORB_CARRY_PAD_H

#include <stdint.h>

/* Gives texels without a colour (known 0) that of the known ones beside them, ring by ring, `rings` times; the rest
 * gets the mean colour. queue: room for side² numbers. */
void orb_pad(unsigned char *rgba, unsigned char *known, int32_t side, int32_t rings, int32_t *queue);

#endif
