/* What has to hold for any octets that come from ROS 2, and for any message that goes there; libFuzzer thinks them up. One program for all
 * messages and profiles: the first octet says which, the second whether the others are CDR (even) or a message (odd).
 *
 *  - reading reads nothing beyond the octets (ASan), does nothing undefined (UBSan), ends, and takes no more memory than it promises
 *  - what it refuses it explains, at an octet that is there; what it takes encode takes as well
 *  - of a message nothing is left out in silence: what comes back from CDR is the message, or it was said what is missing
 *  - CDR that was written, read and written again is the same, whatever was left out of it
 *  - a buffer that is an octet too small is refused, with the number of octets that it takes, and nothing behind it is touched
 */
#include <captain/ros2.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ROOM ((size_t)1 << 24)
#define OCTETS ((size_t)1 << 20)

int LLVMFuzzerTestOneInput(const uint8_t *octets, size_t size);

static _Alignas(16) unsigned char room[2][ROOM];
/* What was read points into its CDR, which therefore stays as it is: what only has to be refused goes elsewhere. */
static unsigned char encoded[2][OCTETS], cdr[2][OCTETS], refused[OCTETS];

static void require(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "finding: %s\n", what);
        abort();
    }
}

static void *start(captain_arena *arena, int which, const captain_type *type)
{
    captain_arena_init(arena, room[which], ROOM);
    return captain_arena_take(arena, type->size);
}

static size_t octets_of(size_t bits)
{
    return bits == 0 ? 1 : (bits + 7) / 8;
}

static bool count_left(void *context, const char *path, const captain_type *type, const void *value)
{
    (void)path;
    require(type != NULL || value != NULL, "something left out is nothing");
    ++*(size_t *)context;
    return true;
}

/* 0: it does not fit. */
static size_t write(const captain_ros2 *ros2, const void *value, int which, size_t *left)
{
    size_t count, again, left_again, told = 0;
    captain_status status = captain_to_cdr(ros2, value, cdr[which], OCTETS, &count, left);
    if (status == CAPTAIN_NO_SPACE || status == CAPTAIN_LENGTH)
        return 0;
    require(status == CAPTAIN_OK, "a value cannot be written as CDR");
    refused[count - 1] = 0xa5;
    require(captain_to_cdr(ros2, value, refused, count - 1, &again, &left_again) == CAPTAIN_NO_SPACE && again == count,
            "a buffer too small is not refused");
    require(refused[count - 1] == 0xa5, "writing goes on behind the buffer");
    captain_cdr_left_out(ros2, value, cdr[which], count, count_left, &told);
    require((told == 0) == (*left == 0), "what is left out is counted, and not told");
    return count;
}

/* A value in room 0: written, read into room 1, and what that is as a message. Of what was left out only that CDR comes back. */
static void there_and_back(const captain_ros2 *ros2, const void *value)
{
    captain_arena arena;
    captain_report report;
    size_t bits, bits_back, left, left_back;
    size_t count = write(ros2, value, 0, &left);
    if (count == 0 || captain_encode(ros2->pdu, value, encoded[0], OCTETS, &bits) != CAPTAIN_OK)
        return;
    void *back = start(&arena, 1, ros2->pdu);
    require(captain_from_cdr(ros2, back, cdr[0], count, left != 0, &arena, &report) == CAPTAIN_OK, "what was written cannot be read");
    require((size_t)(arena.next - room[1]) <= ros2->pdu->size + 64 + (size_t)ros2->arena * count, "reading takes more than it promises");
    require(write(ros2, back, 1, &left_back) == count, "written again it has another length");
    require(memcmp(cdr[0], cdr[1], count) == 0, "written again it is another CDR");
    if (left != 0)
        return;
    require(left_back == 0, "written again something is left out");
    require(captain_encode(ros2->pdu, back, encoded[1], OCTETS, &bits_back) == CAPTAIN_OK, "what came back cannot be encoded");
    require(bits == bits_back && memcmp(encoded[0], encoded[1], octets_of(bits)) == 0, "what came back is another message");
}

static void read_any(const captain_ros2 *ros2, const uint8_t *octets, size_t size)
{
    captain_arena arena;
    captain_report report;
    size_t bits;
    void *value = start(&arena, 1, ros2->pdu);
    captain_from_cdr(ros2, value, octets, size, true, &arena, NULL);
    value = start(&arena, 0, ros2->pdu);
    captain_status status = captain_from_cdr(ros2, value, octets, size, false, &arena, &report);
    require(status != CAPTAIN_NO_MEMORY, "reading takes 16 MB");
    require((size_t)(arena.next - room[0]) <= ros2->pdu->size + 64 + (size_t)ros2->arena * size, "reading takes more than it promises");
    if (status != CAPTAIN_OK) {
        require(report.status == status && report.text[0] != 0 && report.bit <= 8 * size, "a refusal without an explanation");
        return;
    }
    status = captain_encode(ros2->pdu, value, encoded[0], OCTETS, &bits);
    require(status == CAPTAIN_OK || status == CAPTAIN_NO_SPACE || status == CAPTAIN_DEPTH, "what was read cannot be encoded");
    if (status == CAPTAIN_OK)
        there_and_back(ros2, value);
}

static void decode_any(const captain_ros2 *ros2, const uint8_t *octets, size_t size)
{
    captain_arena arena;
    void *value = start(&arena, 0, ros2->pdu);
    if (captain_decode_exact(ros2->pdu, value, octets, size, &arena) == CAPTAIN_OK)
        there_and_back(ros2, value);
}

int LLVMFuzzerTestOneInput(const uint8_t *octets, size_t size)
{
    if (size < 2)
        return 0;
    const captain_ros2 *ros2 = captain_ros2_messages[octets[0] % captain_ros2_messages_count];
    if (octets[1] % 2 == 0)
        read_any(ros2, octets + 2, size - 2);
    else
        decode_any(ros2, octets + 2, size - 2);
    return 0;
}
