/* The heap of the process: what malloc() keeps, see orb_keep_heap(). */
#ifndef ORB_BASE_HEAP_H
#define ORB_BASE_HEAP_H

int orb_heap_is_kept(void);
/* Gives back to the system what is free in the heap, also where it is not kept. */
void orb_heap_give_back(void);

#endif
