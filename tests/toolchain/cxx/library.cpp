// Headers of libc++, calls of the C library from C++, new and delete.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <new>
#include <numeric>
#include <optional>
#include <string_view>
#include <variant>

struct Counted {
    static int alive;
    int value;
    explicit Counted(int value) : value(value)
    {
        alive++;
    }
    ~Counted()
    {
        alive--;
    }
};
int Counted::alive = 0;

std::optional<int> half(int x)
{
    return x % 2 ? std::nullopt : std::optional<int>(x / 2);
}

int main()
{
    std::array<int, 7> a{5, -3, 1, 400, 2, 0, 9};
    std::sort(a.begin(), a.end());
    if (!std::is_sorted(a.begin(), a.end()) || std::accumulate(a.begin(), a.end(), 0) != 414)
        return 1;
    std::sort(a.begin(), a.end(), std::greater<int>());
    if (a[0] != 400 || *std::min_element(a.begin(), a.end()) != -3)
        return 2;
    if (half(8).value_or(0) != 4 || half(7))
        return 3;
    std::string_view text("speed=42");
    if (text.substr(0, text.find('=')) != "speed" || std::atoi(text.data() + 6) != 42)
        return 4;
    {
        auto owner = std::make_unique<Counted>(5);
        auto *several = new Counted[2]{Counted(1), Counted(2)};
        if (Counted::alive != 3 || owner->value + several[1].value != 7)
            return 5;
        delete[] several;
    }
    if (Counted::alive != 0)
        return 6;
    alignas(Counted) unsigned char room[sizeof(Counted)];
    auto *placed = new (room) Counted(8);
    if (placed->value != 8)
        return 7;
    placed->~Counted();
    std::variant<int, char> v = 'x';
    if (!std::holds_alternative<char>(v) || std::get<char>(v) != 'x')
        return 8;
    if (std::numeric_limits<int>::max() != 32767 || std::numeric_limits<long>::digits != 31)
        return 9;
    char buffer[16];
    std::snprintf(buffer, sizeof buffer, "%d/%s", 12, "ab");
    if (std::strcmp(buffer, "12/ab") != 0 || std::abs(-5) != 5)
        return 10;
    volatile double x = 2.25;
    if (std::sqrt(x) != 1.5 || std::fpclassify(x) != FP_NORMAL || std::isnan(x))
        return 11;
    std::atomic<int> n{5};
    if (n.fetch_add(2) != 5 || n.load() != 7)
        return 12;
    return 0;
}
