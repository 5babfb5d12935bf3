// Classes: construction, virtual functions, multiple inheritance, members, operators, statics and their guards.
namespace
{
int order[8];
int made = 0;

struct Note {
    explicit Note(int number) : number(number)
    {
        order[made++] = number;
    }
    ~Note()
    {
        order[made++] = -number;
    }
    int number;
};

struct Shape {
    virtual int area() const = 0;
    virtual int sides() const
    {
        return 0;
    }

  protected:
    ~Shape() = default;
};

struct Named {
    virtual char initial() const = 0;

  protected:
    ~Named() = default;
};

struct Rectangle : Shape, Named {
    Rectangle(int a, int b) : a(a), b(b)
    {
    }
    int area() const override
    {
        return a * b;
    }
    int sides() const override
    {
        return 4;
    }
    char initial() const override
    {
        return 'R';
    }
    int a, b;
};

struct Square final : Rectangle {
    explicit Square(int a) : Rectangle(a, a)
    {
    }
    char initial() const override
    {
        return 'S';
    }
};

struct Fixed {
    long value = 0;
    constexpr Fixed operator+(Fixed other) const
    {
        return {value + other.value};
    }
    constexpr Fixed &operator*=(long factor)
    {
        value *= factor;
        return *this;
    }
    constexpr bool operator==(Fixed other) const
    {
        return value == other.value;
    }
    explicit operator bool() const
    {
        return value != 0;
    }
};

Note before_main(7);
int from_function()
{
    static int calls = 0;
    return ++calls;
}
int guarded()
{
    static int first = from_function();
    return first;
}
struct Big {
    int words[6];
    Big moved(int by) const
    {
        Big result = *this;
        for (int &word : result.words)
            word += by;
        return result;
    }
};
} // namespace

int main()
{
    if (made != 1 || order[0] != 7)
        return 1;
    {
        Note a(1);
        Note b(2);
    }
    if (order[3] != -2 || order[4] != -1)
        return 2;
    Square square(5);
    Rectangle rectangle(2, 3);
    Shape *volatile shapes[] = {&square, &rectangle};
    if (shapes[0]->area() != 25 || shapes[1]->area() != 6 || shapes[0]->sides() != 4)
        return 3;
    Named *volatile named = &square;
    if (named->initial() != 'S' || rectangle.initial() != 'R')
        return 4;
    constexpr Fixed sum = Fixed{40} + Fixed{2};
    static_assert(sum == Fixed{42});
    Fixed product = sum;
    product *= 1000;
    if (!product || product.value != 42000)
        return 5;
    if (guarded() != 1 || guarded() != 1 || from_function() != 2)
        return 6;
    int (Rectangle::*volatile member)() const = &Rectangle::area;
    int Rectangle::*volatile field = &Rectangle::b;
    if ((rectangle.*member)() != 6 || square.*field != 5)
        return 7;
    Big big = {{1, 2, 3, 4, 5, 6}};
    if (big.moved(10).words[5] != 16 || big.words[5] != 6)
        return 8;
    return 0;
}
