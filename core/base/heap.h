/* Whether the process keeps its heap, see orb_keep_heap(). */
#ifndef ORB_BASE_HEAP_H
#define ORB_BASE_HEAP_H

int orb_heap_is_kept(void);

#endif
