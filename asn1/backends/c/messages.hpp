// The message library in C++17: owning values that encode, decode, validate and print, and views that read the C structs
// with std::optional, loops and visit(). Include captain/<module>.hpp for the types of a module.
//
//   auto cam = captain::message<r1_cam_CAM>::decode(octets);          // throws captain::error: path, bit, reason
//   auto parameters = cam.view().cam().camParameters();
//   if (auto low = parameters.lowFrequencyContainer())                // std::optional
//       low->visit(captain::overload{[](auto container) { ... }});    // a CHOICE
//   cam->header.stationID = 42;                                       // the C struct itself, to write
//   std::vector<std::uint8_t> again = cam.encode();
#ifndef CAPTAIN_MESSAGES_HPP
#define CAPTAIN_MESSAGES_HPP

#if defined(_MSVC_LANG) ? _MSVC_LANG < 201703L : __cplusplus < 201703L
#error "captain/messages.hpp needs C++17"
#endif

#include "captain/runtime.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace captain {

// ---------------------------------------------------------------- errors

/// what() is one line: "cam.camParameters: bit 71: out of range: 300 is not in 0..255".
class error : public std::runtime_error {
public:
    explicit error(const captain_report &report)
        : std::runtime_error(line(report)), status_(report.status), bit_(report.bit), path_(report.path), reason_(report.text)
    {
    }
    captain_status status() const noexcept { return status_; }
    std::size_t bit() const noexcept { return bit_; } ///< offset of the invalid value in the octets; 0 for a value in memory
    const std::string &path() const noexcept { return path_; }
    const std::string &reason() const noexcept { return reason_; }

private:
    static std::string line(const captain_report &report)
    {
        std::string text = report.path;
        if (report.bit != 0)
            text += (text.empty() ? "bit " : ": bit ") + std::to_string(report.bit);
        text += text.empty() ? "" : ": ";
        if (report.status == CAPTAIN_PRESENCE && report.text[0] != '\0')
            return text + report.text; // "is missing"
        text += captain_status_text(report.status);
        return report.text[0] == '\0' ? text : text + ": " + report.text;
    }

    captain_status status_;
    std::size_t bit_;
    std::string path_, reason_;
};

// ---------------------------------------------------------------- octets and memory

/// View of octets: from anything with data() and size() whose elements are octets, or from a pointer and a size.
struct octets {
    const std::uint8_t *first = nullptr;
    std::size_t count = 0;

    octets() = default;
    octets(const void *data, std::size_t size) : first(static_cast<const std::uint8_t *>(data)), count(size) {}
    template <class Container, class = std::enable_if_t<sizeof(*std::declval<const Container &>().data()) == 1>>
    octets(const Container &container) : octets(container.data(), container.size()) // NOLINT: implicit, like std::span
    {
    }
    const std::uint8_t *data() const noexcept { return first; }
    std::size_t size() const noexcept { return count; }
    bool empty() const noexcept { return count == 0; }
    const std::uint8_t *begin() const noexcept { return first; }
    const std::uint8_t *end() const noexcept { return first + count; }
    std::uint8_t operator[](std::size_t index) const { return first[index]; }
};

/// Arena that grows up to a limit. Memory that it has handed out does not move, even if the arena object is moved. A moved-from
/// arena is empty.
class memory {
public:
    /// Sufficient for every message of 64 KiB, the largest that a packet can contain.
    static constexpr std::size_t default_limit = std::size_t{64} << 20;

    explicit memory(std::size_t limit = default_limit) : limit_(limit) { captain_arena_init(&arena_, nullptr, 0); }
    memory(memory &&other) noexcept
        : limit_(other.limit_), used_(std::exchange(other.used_, 0)), blocks_(std::exchange(other.blocks_, {})),
          arena_(std::exchange(other.arena_, captain_arena{}))
    {
    }
    memory &operator=(memory other) noexcept
    {
        limit_ = other.limit_;
        used_ = other.used_;
        blocks_.swap(other.blocks_);
        arena_ = other.arena_;
        return *this;
    }

    captain_arena *arena() noexcept
    {
        arena_.more = &memory::more;
        arena_.context = this;
        return &arena_;
    }
    /// Allocate memory that is aligned for any type of the library. Throws std::bad_alloc beyond the limit.
    void *take(std::size_t size)
    {
        void *taken = captain_arena_take(arena(), size);
        return taken != nullptr ? taken : throw std::bad_alloc();
    }
    /// Free everything that was handed out, but keep the memory in one block for the next use.
    void clear()
    {
        if (blocks_.size() > 1) {
            std::size_t size = std::exchange(used_, 0);
            blocks_.clear();
            captain_arena_init(&arena_, nullptr, 0);
            grow(std::min(size, limit_ - alignof(std::max_align_t)));
        } else if (!blocks_.empty()) {
            captain_arena_init(&arena_, blocks_.front().get(), used_);
        }
    }

private:
    static bool more(captain_arena *arena, std::size_t size) noexcept
    {
        try {
            return static_cast<memory *>(arena->context)->grow(size);
        } catch (const std::bad_alloc &) {
            return false;
        }
    }
    bool grow(std::size_t size)
    {
        size = std::max(size + alignof(std::max_align_t), std::max(used_, std::size_t{2048})); // each block is at least as large as all previous ones together
        if (size > limit_ - used_)
            return false;
        blocks_.push_back(std::unique_ptr<unsigned char[]>(new unsigned char[size]));
        used_ += size;
        arena_.next = blocks_.back().get();
        arena_.end = arena_.next + size;
        return true;
    }

    std::size_t limit_, used_ = 0;
    std::vector<std::unique_ptr<unsigned char[]>> blocks_;
    captain_arena arena_;
};

// ---------------------------------------------------------------- values

/// Table of a generated struct: SEQUENCE, CHOICE or SEQUENCE OF. Specialised in captain/<module>.hpp.
template <class T> const captain_type &type_of() noexcept;

/// Find a message by name: "cam-1.4.1", or "cam" for its preferred edition. Throws std::out_of_range.
inline const captain_message &find(const std::string &name)
{
    const captain_message *found = captain_find_message(name.c_str());
    return found != nullptr ? *found : throw std::out_of_range("no message is called " + name);
}

/// Value of any type, with its memory. It can be moved but not copied. A moved-from object has no value until it is read again.
class value {
public:
    /// Initialise: numbers 0, defaults assigned, optional components absent, lists empty.
    explicit value(const captain_type &type, std::size_t limit = memory::default_limit)
        : type_(&type), memory_(limit), data_(memory_.take(type.size))
    {
        captain_init(type_, data_);
    }
    /// Throws error, also for octets after the message.
    [[nodiscard]] static value decode(const captain_type &type, octets from, std::size_t limit = memory::default_limit)
    {
        value made(type, limit);
        made.read(from);
        return made;
    }
    [[nodiscard]] static value from_json(const captain_type &type, std::string_view json, std::size_t limit = memory::default_limit)
    {
        value made(type, limit);
        made.read_json(json);
        return made;
    }

    /// Replace the value. If it throws error, the value is that of a new object.
    void read(octets from)
    {
        captain_status status = try_read(from);
        if (status != CAPTAIN_OK) {
            captain_report report{};
            captain_explain_decode(type_, from.data(), from.size(), true, &report);
            report.status = report.status == CAPTAIN_OK ? status : report.status; // OK: only memory is exhausted
            throw error(report);
        }
    }
    /// The same without exceptions. It reuses the memory of the previous value.
    captain_status try_read(octets from)
    {
        restart();
        captain_status status = captain_decode_exact(type_, data_, from.data(), from.size(), memory_.arena());
        if (status != CAPTAIN_OK)
            captain_init(type_, data_);
        return status;
    }
    void read_json(std::string_view json) { read_json(json, &captain_json_read); }
    /// The plain dialect: SI units, special values by name.
    void read_plain_json(std::string_view json) { read_json(json, &captain_json_read_plain); }
    /// Replace the value by the example of a message, a legal message: see captain_example. Throws error.
    void read_example(const captain_message &of)
    {
        check_type(of);
        restart();
        const captain_status status = captain_example(&of, data_, memory_.arena());
        if (status == CAPTAIN_NO_MEMORY)
            throw std::bad_alloc();
        check(status, true);
    }
    /// Set a field by short name or path: set(cam, "speed", "13.9"), see captain_set. Throws error; then read the value again.
    void set(const captain_message &of, const std::string &name, const std::string &text)
    {
        check_type(of);
        captain_report report{};
        if (captain_set(&of, data_, name.c_str(), text.c_str(), memory_.arena(), &report) != CAPTAIN_OK)
            throw error(report);
    }

    /// Throws error if the value cannot be encoded.
    std::vector<std::uint8_t> encode() const
    {
        std::vector<std::uint8_t> to(512);
        std::size_t bits = 0;
        captain_status status;
        while ((status = captain_encode(type_, data_, to.data(), to.size(), &bits)) == CAPTAIN_NO_SPACE)
            to.resize(4 * to.size());
        check(status, false);
        to.resize(std::max(std::size_t{1}, (bits + 7) / 8));
        return to;
    }
    /// Check every constraint of the standard. Throws error.
    void validate() const { check(captain_validate(type_, data_), true); }
    captain_status try_validate() const noexcept { return captain_validate(type_, data_); }

    std::string json() const { return written(&captain_json_write); }
    std::string plain_json() const { return written(&captain_json_write_plain); }
    std::string text() const { return written(&captain_print); }

    const captain_type &type() const noexcept { return *type_; }
    const void *data() const noexcept { return data_; }
    void *data() noexcept { return data_; }
    /// Allocate memory that lives as long as the value, for its lists, pointers and strings.
    template <class U> U *make(std::size_t count = 1)
    {
        static_assert(std::is_trivial_v<U>, "memory of a message holds C structs");
        U *made = static_cast<U *>(memory_.take(std::max(count, std::size_t{1}) * sizeof(U)));
        std::uninitialized_value_construct_n(made, count);
        return made;
    }
    friend bool operator==(const value &left, const value &right)
    {
        return left.type_ == right.type_ && captain_equal(left.type_, left.data_, right.data_);
    }
    friend bool operator!=(const value &left, const value &right) { return !(left == right); }

private:
    using writer = captain_status (*)(const captain_type *, const void *, captain_sink, void *);
    using json_reader = captain_status (*)(const captain_type *, void *, const char *, std::size_t, captain_arena *, captain_report *);

    void restart()
    {
        memory_.clear();
        data_ = memory_.take(type_->size);
    }
    void read_json(std::string_view json, json_reader read)
    {
        restart();
        captain_report report{};
        if (read(type_, data_, json.data(), json.size(), memory_.arena(), &report) != CAPTAIN_OK) {
            captain_init(type_, data_);
            throw error(report);
        }
    }
    void check_type(const captain_message &of) const
    {
        if (of.pdu != type_)
            throw std::invalid_argument(std::string(of.name) + " is a message of another type");
    }
    void check(captain_status status, bool is_strict) const
    {
        if (status == CAPTAIN_OK)
            return;
        captain_report report{};
        captain_explain_value(type_, data_, is_strict, &report);
        throw error(report);
    }
    std::string written(writer write) const
    {
        std::string text;
        if (write(type_, data_, &append, &text) != CAPTAIN_OK)
            throw std::bad_alloc();
        return text;
    }
    static bool append(void *context, const char *text, std::size_t count) noexcept
    {
        try {
            static_cast<std::string *>(context)->append(text, count);
            return true;
        } catch (const std::exception &) {
            return false;
        }
    }

    const captain_type *type_;
    memory memory_;
    void *data_;
};

template <class Lazy, class T> auto see(const T &value);

/// Value of a generated struct: message<r1_cam_CAM>.
template <class T> class message : public value {
public:
    explicit message(std::size_t limit = memory::default_limit) : value(type_of<T>(), limit) {}
    [[nodiscard]] static message decode(octets from, std::size_t limit = memory::default_limit)
    {
        message made(limit);
        made.read(from);
        return made;
    }
    [[nodiscard]] static message from_json(std::string_view json, std::size_t limit = memory::default_limit)
    {
        message made(limit);
        made.read_json(json);
        return made;
    }
    T &operator*() noexcept { return *static_cast<T *>(data()); }
    T *operator->() noexcept { return static_cast<T *>(data()); }
    const T &operator*() const noexcept { return *static_cast<const T *>(data()); }
    const T *operator->() const noexcept { return static_cast<const T *>(data()); }
    /// The view is valid until the message is destroyed or decoded into again.
    auto view() const { return see<void>(**this); }
};

// ---------------------------------------------------------------- views

/// View of a SEQUENCE or CHOICE: one generated method per component. *view is the C struct. The parameter Lazy delays the
/// compilation of methods until they are called, when all modules are known.
template <class T, class Lazy = void> class view;

template <class T> class record {
public:
    explicit record(const T &of) noexcept : self_(&of) {}
    const T &operator*() const noexcept { return *self_; }

protected:
    const T *self_; // names of components do not end in an underscore, unless they are keywords of C++
};

/// Visitor of a CHOICE, made of lambdas.
template <class... F> struct overload : F... {
    using F::operator()...;
};
template <class... F> overload(F...) -> overload<F...>;

/// Argument of visit() for an unknown alternative of a later edition; std::monostate means that none is chosen.
struct unknown {
    std::uint32_t index;
    octets encoding;
};

/// BIT STRING of variable size; bit 0 is the first.
struct bits {
    const std::uint8_t *first;
    std::size_t count;
    std::size_t size() const noexcept { return count; }
    bool operator[](std::size_t index) const { return (first[index / 8] >> (7 - index % 8) & 1) != 0; }
};

/// SEQUENCE OF and SET OF.
template <class T, class Lazy> class list {
public:
    class iterator {
    public:
        explicit iterator(const T *at) noexcept : at_(at) {}
        auto operator*() const { return see<Lazy>(*at_); }
        iterator &operator++() noexcept { return ++at_, *this; }
        bool operator==(const iterator &other) const noexcept { return at_ == other.at_; }
        bool operator!=(const iterator &other) const noexcept { return at_ != other.at_; }

    private:
        const T *at_;
    };
    list(const T *items, std::size_t count) noexcept : items_(items), count_(count) {}
    std::size_t size() const noexcept { return count_; }
    bool empty() const noexcept { return count_ == 0; }
    auto operator[](std::size_t index) const { return see<Lazy>(items_[index]); }
    iterator begin() const noexcept { return iterator(items_); }
    iterator end() const noexcept { return iterator(items_ + count_); }

private:
    const T *items_;
    std::size_t count_;
};

/// Open type: as<T>() if it contains a T; octets if its identifier is unknown.
class open {
public:
    explicit open(const captain_open &of) noexcept : self_(&of) {}
    const captain_type *type() const noexcept { return self_->type; }
    octets encoding() const noexcept { return {self_->octets.octets, self_->type ? 0U : self_->octets.count}; }
    template <class T> auto as() const
    {
        using seen = decltype(see<void>(std::declval<const T &>()));
        return self_->type == &type_of<T>() ? std::optional<seen>(see<void>(*static_cast<const T *>(self_->value)))
                                            : std::nullopt;
    }

private:
    const captain_open *self_;
};

namespace detail {
template <class T, class = void> struct has_view : std::false_type {};
template <class T> struct has_view<T, std::void_t<decltype(sizeof(view<T>))>> : std::true_type {};
template <class T, class = void> struct is_list : std::false_type {};
template <class T> struct is_list<T, std::void_t<decltype(std::declval<T>().items)>> : std::true_type {};
} // namespace detail

/// Convert a C value to C++: a view, a list, a string_view, octets, bits, or the number itself.
template <class Lazy, class T> auto see(const T &value)
{
    if constexpr (std::is_pointer_v<T>)
        return see<Lazy>(*value);
    else if constexpr (std::is_same_v<T, captain_text>)
        return std::string_view(value.text, value.count);
    else if constexpr (std::is_same_v<T, captain_octets>)
        return octets(value.octets, value.count);
    else if constexpr (std::is_same_v<T, captain_bits>)
        return bits{value.octets, value.count};
    else if constexpr (std::is_same_v<T, captain_open>)
        return open(value);
    else if constexpr (std::is_array_v<T>)
        return octets(value, sizeof value);
    else if constexpr (detail::is_list<T>::value)
        return list<std::remove_pointer_t<decltype(value.items)>, Lazy>(value.items, value.count);
    else if constexpr (detail::has_view<T>::value)
        return view<T>(value);
    else if constexpr (sizeof(T) == 1 && !std::is_same_v<T, bool>)
        return int{value}; // int, because a stream would print one octet as a character
    else
        return value;
}

/// The same for an optional component. The value of an absent one is not read.
template <class Lazy, class T> auto see_if(bool is_present, const T &value)
{
    using seen = decltype(see<Lazy>(value));
    return is_present ? std::optional<seen>(see<Lazy>(value)) : std::nullopt;
}

} // namespace captain

#endif
