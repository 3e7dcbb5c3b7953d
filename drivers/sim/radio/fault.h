/* Error numbers of failed calls, from two generations of the SDK, and their texts. */
#ifndef FAULT_H
#define FAULT_H

enum fault {
    FAULT_NONE,
    FAULT_NOT_INITIALISED,
    FAULT_CONFIG,
    FAULT_IP,
    FAULT_OVER_LIMIT,
    FAULT_NOT_AVAILABLE,
    FAULT_TX_UNKNOWN,
    FAULT_TX_THREAD,
    FAULT_TX_MODE,
    FAULT_TX_ANSWER,
    FAULT_TX_TOO_LONG,
    FAULT_RX_TIMEOUT,
    FAULT_RX_UNKNOWN,
    FAULT_RX_THREAD,
    FAULT_RX_MODE,
    FAULT_RX_LOST,
    FAULT_RX_BUFFER,
    FAULT_RELEASE_UNKNOWN,
    FAULT_RELEASE_THREAD,
    FAULTS
};

/* Returns the number of a fault; is_old selects that of SDK 1.7. */
int fault_number(enum fault fault, int is_old);

/* Returns the text of error_msg() for a number. */
const char *fault_text(int number, int is_old);

#endif
