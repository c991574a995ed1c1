/* C++ allocates through malloc, which torture.c may make fail. */
#include <cstdlib>
#include <new>

void *operator new(std::size_t size) {
  void *block = std::malloc(size ? size : 1);
  if (!block) {
    throw std::bad_alloc();
  }
  return block;
}
void *operator new[](std::size_t size) {
  return operator new(size);
}
void operator delete(void *block) noexcept {
  std::free(block);
}
void operator delete(void *block, std::size_t) noexcept {
  std::free(block);
}
void operator delete[](void *block) noexcept {
  std::free(block);
}
void operator delete[](void *block, std::size_t) noexcept {
  std::free(block);
}
