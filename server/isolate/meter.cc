/* A block is counted by what malloc() gives for it, when it is taken and when it is freed, so no block needs a header.
 * One that was taken before the meter runs and is freed while it does lowers the count by what it never raised: Draco
 * frees none that it has not taken itself.
 *
 * Rejected: a lower RLIMIT_DATA around such calls. It is one of the process, so what other threads take would count,
 * and the answer would be that of a machine out of memory, not of a budget that can be raised. */
#include "isolate/meter.h"

#include <algorithm>
#include <cstdlib>
#include <new>

#include <malloc.h>

#include "isolate/sandbox.h"

namespace {

struct Meter {
  orb_context *ctx;
  size_t counted; /* bytes that the budget has without this */
  size_t charged; /* and by this */
  size_t taken;   /* that are in use */
};

thread_local Meter meter;

}  // namespace

extern "C" void meter_set(orb_context *ctx, size_t counted) {
  if (meter.ctx && meter.ctx != ctx) {
    orb_memory_discharge(meter.ctx, meter.charged);
    meter = Meter{};
  }
  meter.ctx = ctx;
  meter.counted = counted;
}

#if !SANDBOX_SANITIZED
namespace {

const size_t PART = 1u << 20; /* bytes: what is charged at one time, at least, since most of what is taken is small */

bool take(size_t bytes) {
  const size_t room = meter.counted + meter.charged, taken = meter.taken + bytes;
  if (taken > room) {
    const size_t wanted = std::max(taken - room, PART);
    if (orb_memory_charge(meter.ctx, wanted) != ORB_OK) {
      return false;
    }
    meter.charged += wanted;
  }
  meter.taken = taken;
  return true;
}

void give(size_t bytes) {
  meter.taken -= std::min(bytes, meter.taken);
}

}  // namespace

void *operator new(std::size_t size) {
  void *block = std::malloc(size ? size : 1);
  if (block && meter.ctx && !take(malloc_usable_size(block))) {
    std::free(block);
    block = nullptr;
  }
  if (!block) {
    throw std::bad_alloc();
  }
  return block;
}
void operator delete(void *block) noexcept {
  if (block && meter.ctx) {
    give(malloc_usable_size(block));
  }
  std::free(block);
}
void operator delete(void *block, std::size_t) noexcept {
  operator delete(block);
}
#endif
