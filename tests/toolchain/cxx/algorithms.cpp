// Algorithms of libc++ that use vectors, and reductions of vectors.
#include <algorithm>
#include <array>
#include <numeric>
typedef int v4 __attribute__((vector_size(8)));
typedef float f2 __attribute__((vector_size(8)));
static int reduced(v4 a) { return __builtin_reduce_max(a) + 10 * __builtin_reduce_min(a) + 100 * __builtin_reduce_add(a) + __builtin_reduce_xor(a) + __builtin_reduce_or(a) + __builtin_reduce_and(a); }
template <class T> int all(T first) {
  std::array<T, 9> a{};
  for (int i = 0; i < 9; i++) a[i] = (T)(first + (i * 5) % 9);
  std::array<T, 9> b = a;
  auto it = std::find(a.begin(), a.end(), (T)(first + 4));
  if (it == a.end() || *it != (T)(first + 4)) return 1;
  if (std::find(a.begin(), a.end(), (T)(first + 50)) != a.end()) return 2;
  if (std::mismatch(a.begin(), a.end(), b.begin()).first != a.end() || !std::equal(a.begin(), a.end(), b.begin())) return 3;
  b[7]++;
  if (std::mismatch(a.begin(), a.end(), b.begin()).first - a.begin() != 7) return 4;
  if (std::count(a.begin(), a.end(), first) != 1) return 5;
  std::sort(a.begin(), a.end());
  if (!std::is_sorted(a.begin(), a.end()) || *std::max_element(a.begin(), a.end()) != (T)(first + 8)) return 6;
  if (*std::lower_bound(a.begin(), a.end(), (T)(first + 3)) != (T)(first + 3)) return 7;
  std::reverse(a.begin(), a.end());
  std::rotate(a.begin(), a.begin() + 2, a.end());
  if (a[0] != (T)(first + 6) || std::accumulate(a.begin(), a.end(), 0L) != 9L * first + 36) return 8;
  return 0;
}
int main() {
  int e;
  if ((e = all<signed char>(3))) return e;
  if ((e = all<int>(-2))) return 10 + e;
  if ((e = all<unsigned>(7))) return 20 + e;
  if ((e = all<long>(100000L))) return 30 + e;
  if ((e = all<long long>(-5))) return 40 + e;
  volatile int x = 5;
  v4 v = {x, -3, 9, 2};
  return reduced(v) != 9 - 30 + 1300 + (5 ^ -3 ^ 9 ^ 2) + (5 | -3 | 9 | 2) + (5 & -3 & 9 & 2);
}
