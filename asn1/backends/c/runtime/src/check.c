/* Checks that encoding and the reader of JSON share: values that the encoding cannot represent. */
#include "characters.h"
#include "explain.h"

captain_status captain_check_number(const captain_type *type, int64_t number, captain_report *report, const captain_path *path)
{
    if ((type->flags & CAPTAIN_EXTENSIBLE) || captain_walk_in_range(type, number))
        return CAPTAIN_OK;
    char found[CAPTAIN_RANGE_TEXT], allowed[CAPTAIN_RANGE_TEXT];
    return captain_walk_refuse(report, path, 0, CAPTAIN_RANGE, "%s is not in %s", captain_number_text(type, number, found),
                          captain_range_text(type, allowed));
}

/* Limit that decode has as well, because a few octets could announce any number of elements or characters without bits. */
static bool is_unbounded(const captain_type *type, uint64_t count)
{
    if (count <= EXPLAIN_MAX_EMPTY)
        return false;
    if (type->kind == CAPTAIN_LIST)
        return captain_explain_least_bits(type->element) == 0;
    bool is_known_multiplier = captain_walk_is_string(type) && type->kind != CAPTAIN_UTF8;
    return is_known_multiplier && type->character_bits == 0 && captain_walk_in_size(type, count);
}

captain_status captain_check_size(const captain_type *type, uint64_t count, captain_report *report, const captain_path *path)
{
    if (is_unbounded(type, count))
        return captain_walk_refuse(report, path, 0, CAPTAIN_SIZE, EXPLAIN_EMPTY_TEXT, captain_size_noun(type));
    if ((type->flags & CAPTAIN_EXTENSIBLE) || captain_walk_in_size(type, count))
        return CAPTAIN_OK;
    char allowed[CAPTAIN_RANGE_TEXT];
    return captain_walk_refuse(report, path, 0, CAPTAIN_SIZE, "%llu %s are there, %s are allowed", (unsigned long long)count,
                          captain_size_noun(type), captain_size_text(type, allowed));
}

captain_status captain_check_text(const captain_type *type, bool in_root, const char *text, uint32_t octets,
                                  captain_report *report, const captain_path *path)
{
    if (type->kind == CAPTAIN_UTF8) {
        if (captain_utf8_is_valid(text, octets))
            return CAPTAIN_OK;
        return captain_walk_refuse(report, path, 0, CAPTAIN_ALPHABET, "the octets are not UTF-8");
    }
    captain_characters set = in_root ? captain_alphabet(type) : captain_whole_alphabet(type);
    for (uint32_t i = 0; i < octets; i++) {
        unsigned code = (unsigned char)text[i];
        if (captain_code_of(&set, (unsigned char)code) >= 0)
            continue;
        char shown[8] = {'"', (char)code, '"', ',', ' ', 0};
        return captain_walk_refuse(report, path, 0, CAPTAIN_ALPHABET, "character %u, %scode %u, is not in the alphabet of %s",
                                   i + 1, code > 32 && code < 127 ? shown : "", code, captain_type_text(type));
    }
    return CAPTAIN_OK;
}

/* Return whether the encoding contains a field: a value equal to its default is omitted (19.5). */
static bool is_encoded(const captain_field *field, const void *structure)
{
    if (!captain_walk_is_present(field, structure))
        return false;
    const void *value = captain_walk_field(field, structure);
    return !(field->flags & CAPTAIN_DEFAULT) || value == NULL || !captain_equal(field->type, value, field->default_value);
}

/* Return the first present field of a group, or NULL. */
static const captain_field *group_member(const captain_type *type, const void *structure, unsigned addition, bool is_strict)
{
    for (unsigned i = type->root_count; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        bool is_there = is_strict ? captain_walk_is_present(field, structure) : is_encoded(field, structure);
        if (field->addition == addition && is_there)
            return field;
    }
    return NULL;
}

captain_status captain_check_groups(const captain_type *type, const void *structure, bool is_strict, captain_report *report,
                                    captain_path *path)
{
    for (unsigned i = type->root_count; i < type->fields_count; i++) {
        const captain_field *field = &type->fields[i];
        bool is_needed = (field->flags & CAPTAIN_GROUP) && (field->flags & CAPTAIN_MANDATORY);
        if (!is_needed || (field->flags & CAPTAIN_DEFAULT) || captain_walk_is_present(field, structure))
            continue;
        const captain_field *other = group_member(type, structure, field->addition, is_strict);
        if (other == NULL)
            continue;
        captain_path_push(path, field->name);
        return captain_walk_refuse(report, path, 0, CAPTAIN_PRESENCE, "is missing: %s is there, and both come together",
                                   other->name);
    }
    return CAPTAIN_OK;
}
