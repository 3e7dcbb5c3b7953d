/* Times of what asn1c made of one message: PDU is the name of its type. Debian's 0.9.28 and later ones. */
#include "times.h"

#define JOINED(a, b) a##b
#define HEADER(name) <name.h>
#define DESCRIPTOR(name) JOINED(asn_DEF_, name)
#include HEADER(PDU)

#if __has_include("uper_encoder.h")
#include <uper_decoder.h>
#include <uper_encoder.h>
#define TO_BUFFER(value) uper_encode_to_buffer(&DESCRIPTOR(PDU), NULL, value, again, sizeof again)
#else
#include <per_decoder.h>
#include <per_encoder.h>
#define TO_BUFFER(value) uper_encode_to_buffer(&DESCRIPTOR(PDU), value, again, sizeof again)
#endif

static void use(const char *message)
{
    (void)message;
}

static void *decode(size_t count)
{
    void *value = NULL;
    asn_dec_rval_t result = uper_decode_complete(NULL, &DESCRIPTOR(PDU), &value, octets, count);
    if (result.code != RC_OK)
        fail("does not decode it", "");
    return value;
}

static void release(void *value)
{
    ASN_STRUCT_FREE(DESCRIPTOR(PDU), value);
}

static void encode(const void *value)
{
    asn_enc_rval_t result = TO_BUFFER((void *)value); /* 0.9.28 takes no const */
    if (result.encoded < 0)
        fail("does not encode ", result.failed_type == NULL ? "it" : result.failed_type->name);
}
