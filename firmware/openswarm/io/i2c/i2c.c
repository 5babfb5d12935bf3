/* I2C: one transfer at a time, stepped by the interrupt, guarded by a time-out. */
#include "i2c.h"

#include "hal_i2c.h"
#include "kernel.h"

static volatile uint8 result; /* an i2c_result; I2C_BUSY while the interrupt works */
static bool taken;

bool i2c_stepped(void)
{
    result = (uint8)i2c_advance();
    return result != I2C_BUSY;
}

static bool take(void)
{
    hal_lock_state lock = hal_lock_devices();
    bool was_free = !taken;
    taken = true;
    hal_unlock(lock);
    return was_free;
}

static i2c_result transfer_now(const i2c_transfer *transfer)
{
    if (!i2c_bus_is_free() && !i2c_recover()) {
        return I2C_STUCK;
    }
    result = I2C_BUSY;
    hal_i2c_begin(transfer);
    for (uint8 ms = 0; result == I2C_BUSY && ms < SYS_I2C_TIMEOUT_MS; ms++) {
        Sys_Sleep(1);
    }
    hal_i2c_end();
    i2c_result seen = result == I2C_BUSY ? I2C_TIMEOUT : (i2c_result)result;
    if ((seen == I2C_TIMEOUT || seen == I2C_COLLISION) && !i2c_recover()) {
        seen = I2C_STUCK;
    }
    return seen;
}

i2c_result Sys_I2C_Transfer(const i2c_transfer *transfer)
{
    if (!hal_in_thread()) {
        (void)os_refuse();
        return I2C_BUSY;
    }
    if (!take()) {
        (void)os_fail(SYS_ERROR_BUSY);
        return I2C_BUSY;
    }
    i2c_result seen = transfer_now(transfer);
    taken = false;
    return seen;
}

void Sys_Start_I2C(void)
{
    taken = false;
    hal_i2c_start();
}
