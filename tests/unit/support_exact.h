/* Exact arithmetic for the tests: schoolbook integers that share no code with the library. */
#ifndef SUPPORT_EXACT_H
#define SUPPORT_EXACT_H

/* The sign of det(a, b, c) for any finite doubles. */
int exact_orientation(const double a[3], const double b[3], const double c[3]);

#endif
