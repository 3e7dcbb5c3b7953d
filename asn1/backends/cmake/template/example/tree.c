/* Example: prints any message as a tree: tree MESSAGE HEX, such as: tree cam 0202... Without arguments it lists the messages of
 * the library. */
#include <captain/runtime.h>

#include <ctype.h>
#include <stdio.h>
#include <string.h>

static bool write_out(void *file, const char *text, size_t octets)
{
    return fwrite(text, 1, octets, file) == octets;
}

/* Return the number of octets; -1 if the text is not an even number of hexadecimal digits, or too long. */
static int from_hex(const char *text, unsigned char *octets, size_t room)
{
    size_t count = 0;
    for (; isxdigit((unsigned char)text[0]) && isxdigit((unsigned char)text[1]); text += 2) {
        unsigned int octet;
        if (count == room || sscanf(text, "%2x", &octet) != 1)
            return -1;
        octets[count++] = (unsigned char)octet;
    }
    return *text == '\0' ? (int)count : -1;
}

static int list_messages(void)
{
    for (size_t i = 0; i < captain_messages_count; i++)
        printf("%-20s %s\n", captain_messages[i]->name, captain_messages[i]->standard);
    return 0;
}

int main(int argc, char **argv)
{
    /* The arena has the parts that decode cannot put into the struct. Its fixed size limits the memory of any message. */
    static _Alignas(16) unsigned char memory[1 << 20], value[1 << 20];
    static unsigned char octets[65536];

    if (argc == 1)
        return list_messages();
    const captain_message *message = captain_find_message(argv[1]);
    int size = argc == 3 ? from_hex(argv[2], octets, sizeof octets) : -1;
    if (message == NULL || size < 0 || message->pdu->size > sizeof value) {
        fprintf(stderr, "usage: tree MESSAGE HEX\n");
        return 2;
    }
    captain_arena arena;
    captain_arena_init(&arena, memory, sizeof memory);
    captain_status status = captain_decode_exact(message->pdu, value, octets, (size_t)size, &arena);
    if (status != CAPTAIN_OK) {
        captain_report report;
        memset(&report, 0, sizeof report);
        captain_explain_decode(message->pdu, octets, (size_t)size, true, &report);
        fprintf(stderr, "%s: bit %zu: %s: %s\n", report.path, report.bit, captain_status_text(status), report.text);
        return 1;
    }
    return captain_print(message->pdu, value, write_out, stdout) == CAPTAIN_OK ? 0 : 1;
}
