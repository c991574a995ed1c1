/* Reading numbers from bytes of either order, at any alignment. */
#ifndef ORB_FORMAT_BYTES_H
#define ORB_FORMAT_BYTES_H

#include <stdint.h>
#include <string.h>

static inline int orb_host_is_big(void) {
  return __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
}

static inline uint16_t orb_read_u16(const unsigned char *p, int big) {
  uint16_t value;
  memcpy(&value, p, sizeof value);
  return big != orb_host_is_big() ? __builtin_bswap16(value) : value;
}

static inline uint32_t orb_read_u32(const unsigned char *p, int big) {
  uint32_t value;
  memcpy(&value, p, sizeof value);
  return big != orb_host_is_big() ? __builtin_bswap32(value) : value;
}

static inline uint64_t orb_read_u64(const unsigned char *p, int big) {
  uint64_t value;
  memcpy(&value, p, sizeof value);
  return big != orb_host_is_big() ? __builtin_bswap64(value) : value;
}

static inline double orb_read_f32(const unsigned char *p, int big) {
  uint32_t bits = orb_read_u32(p, big);
  float value;
  memcpy(&value, &bits, sizeof value);
  return (double)value;
}

static inline double orb_read_f64(const unsigned char *p, int big) {
  uint64_t bits = orb_read_u64(p, big);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

#endif
