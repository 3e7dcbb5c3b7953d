#include "fault.h"

#include <stddef.h>

static const struct {
    int now, old;
    const char *text;
} ROWS[FAULTS] = {
    [FAULT_NONE] = {0, 0, "success"},
    [FAULT_NOT_INITIALISED] = {-6146, -6143, "Caster is not initialized"},
    [FAULT_CONFIG] = {-6152, -6146, "Caster create: invalid config"},
    [FAULT_IP] = {-6153, -6147, "Caster create: invalid IP"},
    [FAULT_OVER_LIMIT] = {-6154, -6148, "Caster create: caster number over limit"},
    [FAULT_NOT_AVAILABLE] = {-6156, -6150, "Caster create: V2Xcast service is not available"},
    [FAULT_TX_UNKNOWN] = {-6162, -6156, "Caster TX: caster does not exist"},
    [FAULT_TX_THREAD] = {-6163, -6157, "Caster TX: thread id mismatch"},
    [FAULT_TX_MODE] = {-6164, -6158, "Caster TX: communication mode mismatch"},
    [FAULT_TX_ANSWER] = {-6169, -6163, "Caster TX: no answer to the TX request"},
    [FAULT_TX_TOO_LONG] = {-6171, -6165, "Caster TX: packet overload, at most 1500 octets"},
    [FAULT_RX_TIMEOUT] = {-6173, -6171, "Caster RX timeout"},
    [FAULT_RX_UNKNOWN] = {-6174, -6166, "Caster RX: caster does not exist"},
    [FAULT_RX_THREAD] = {-6175, -6167, "Caster RX: thread id mismatch"},
    [FAULT_RX_MODE] = {-6176, -6168, "Caster RX: communication mode mismatch"},
    [FAULT_RX_LOST] = {-6177, -6169, "Caster RX: the subscription failed"},
    [FAULT_RX_BUFFER] = {-6179, -6172, "Caster RX: insufficient buffer"},
    [FAULT_RELEASE_UNKNOWN] = {-6205, -6198, "Caster release: caster does not exist"},
    [FAULT_RELEASE_THREAD] = {-6206, -6199, "Caster release: thread id mismatch"},
};

int fault_number(enum fault fault, int is_old)
{
    return is_old ? ROWS[fault].old : ROWS[fault].now;
}

const char *fault_text(int number, int is_old)
{
    for (size_t at = 0; at < FAULTS; at++)
        if ((is_old ? ROWS[at].old : ROWS[at].now) == number)
            return ROWS[at].text;
    return "unknown error";
}
