// Templates, lambdas, constexpr, range loops, structured bindings, fold expressions, if constexpr.
#include <array>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>

template <typename T, unsigned N> class Ring
{
  public:
    bool push(const T &item)
    {
        if (count == N)
            return false;
        items[(first + count++) % N] = item;
        return true;
    }
    bool pop(T &item)
    {
        if (count == 0)
            return false;
        item = items[first];
        first = (first + 1) % N;
        --count;
        return true;
    }

  private:
    T items[N]{};
    unsigned first = 0, count = 0;
};

template <typename... T> constexpr auto total(T... values)
{
    return (values + ...);
}

template <typename T> constexpr int kind()
{
    if constexpr (std::is_floating_point_v<T>)
        return 1;
    else if constexpr (sizeof(T) > 2)
        return 2;
    else
        return 3;
}

constexpr std::array<std::uint16_t, 16> table = [] {
    std::array<std::uint16_t, 16> t{};
    for (unsigned i = 0; i < t.size(); i++)
        t[i] = static_cast<std::uint16_t>(i * i);
    return t;
}();

template <typename F> int twice(F f, int x)
{
    return f(f(x));
}

int main()
{
    Ring<long, 3> ring;
    if (!ring.push(100000) || !ring.push(2) || !ring.push(3) || ring.push(4))
        return 1;
    long item = 0;
    if (!ring.pop(item) || item != 100000 || !ring.push(5))
        return 2;
    for (long expected : {2L, 3L, 5L})
        if (!ring.pop(item) || item != expected)
            return 3;
    if (total(1, 2L, 3) != 6 || total(0.5f, 0.25f) != 0.75f)
        return 4;
    if (kind<float>() != 1 || kind<long>() != 2 || kind<char>() != 3)
        return 5;
    volatile unsigned at = 9;
    if (table[at] != 81)
        return 6;
    volatile int offset = 10;
    int calls = 0;
    if (twice([&](int x) { calls++; return x + offset; }, 1) != 21 || calls != 2)
        return 7;
    auto [a, b] = std::pair<int, long>{3, 70000L};
    if (a != 3 || b != 70000)
        return 8;
    auto summed = std::apply([](auto... v) { return total(v...); }, std::tuple<int, long, int>{1, 2, 3});
    return summed == 6 ? 0 : 9;
}
