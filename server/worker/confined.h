/* Runs a job in a process of its own, which gets its inputs from the channel. */
#ifndef ORB_WORKER_CONFINED_H
#define ORB_WORKER_CONFINED_H

/* Runs the task that the channel brings: a job, or checks of uploads. Ends the process. */
void confined_work(int channel);

#endif
