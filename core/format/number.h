/* Decimal numbers from text: correctly rounded, the same in every locale, O(length). */
#ifndef ORB_FORMAT_NUMBER_H
#define ORB_FORMAT_NUMBER_H

/* Reads one number at p (no leading blanks): digits with or without a point, exponents after e, E, d or D, "inf" and
 * "nan" in any case. Returns the position after it, NULL if there is no number. Overflow gives an infinity. */
const unsigned char *orb_number_parse(const unsigned char *p, const unsigned char *end, double *out);

#endif
