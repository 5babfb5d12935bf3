// The kernel from C++: behaviours with a common interface take turns; README.md.
#include <openswarm.h>
#include <openswarm_io.h>

#include <array>
#include <cstdio>
#include <cstring>

namespace
{

class Behaviour
{
  public:
    virtual const char *name() const = 0;
    virtual sys_wheel_speeds speeds(uint16 turn) const = 0;

  protected:
    ~Behaviour() = default;
};

class Straight : public Behaviour
{
  public:
    explicit constexpr Straight(sint16 mm_per_s) : speed(mm_per_s)
    {
    }
    const char *name() const override
    {
        return "straight";
    }
    sys_wheel_speeds speeds(uint16) const override
    {
        return {speed, speed};
    }

  private:
    sint16 speed;
};

template <sint16 Speed> class Spin : public Behaviour
{
  public:
    const char *name() const override
    {
        return "spin";
    }
    sys_wheel_speeds speeds(uint16 turn) const override // the other way round every time
    {
        return turn / 2 % 2 != 0 ? sys_wheel_speeds{Speed, -Speed} : sys_wheel_speeds{-Speed, Speed};
    }
};

template <typename T, std::size_t N> class Cycle
{
  public:
    template <typename... Items> explicit constexpr Cycle(Items... items) : all{items...}
    {
    }
    T next()
    {
        T item = all[at];
        at = (at + 1) % N;
        return item;
    }

  private:
    std::array<T, N> all;
    std::size_t at = 0;
};

// Counts what it makes: its constructor runs before main, at a value no constant could have.
class Turns
{
  public:
    Turns() : first(static_cast<uint16>(Sys_Get_SystemTime() + 1)), count(first)
    {
    }
    uint16 take()
    {
        return count++;
    }

  private:
    uint16 first;
    uint16 count;
};

const Straight straight(60);
const Spin<30> spin;
Turns turns;

Cycle<const Behaviour *, 2> &plan()
{
    static Cycle<const Behaviour *, 2> cycle(&straight, &spin);
    return cycle;
}

void patrol()
{
    char message[32];
    for (;;) {
        const Behaviour &behaviour = *plan().next();
        const uint16 turn = turns.take();
        const sys_wheel_speeds speeds = behaviour.speeds(turn);
        Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, static_cast<uint16>(speeds.left));
        Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, static_cast<uint16>(speeds.right));
        std::snprintf(message, sizeof message, "%u %s %d %d\r\n", turn, behaviour.name(), speeds.left, speeds.right);
        Sys_Send_Event(SYS_SEND_UART1, message, static_cast<uint16>(std::strlen(message)));
        Sys_Sleep(500);
    }
}

} // namespace

int main()
{
    Sys_Init_Kernel();
    SYS_ASSERT(Sys_Start_Process(patrol) != 0);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
