// Test driver of the client: driver STATION TIMEOUT_MS. Answers each JSON object of its input with a line.
#include <captain_client.hpp>

#include <csignal>
#include <iostream>
#include <optional>

using captain_client::Form;
using nlohmann::json;

static const captain_client::Milliseconds PATIENCE{15000}; // reached only by a test that fails

static Form form_of(const json &question)
{
    const std::string name = question.value("form", "plain");
    return name == "plain" ? Form::plain : name == "json" ? Form::json : Form::pdu;
}

static json shown(const captain_client::Confirmed &outcome)
{
    json dropped = json::array();
    for (const auto &one : outcome.dropped)
        dropped.push_back({one.interface, one.reason});
    return {{"sent", outcome.sent}, {"dropped", dropped}};
}

static json shown(const captain_client::Message &message)
{
    return {{"type", message.type}, {"station", message.station ? json(*message.station) : json()}, {"edition", message.edition},
            {"error", message.error}, {"pdu", message.pdu}, {"interface", message.interface}, {"received_ns", message.received_ns},
            {"rssi_dbm", message.rssi_dbm ? json(*message.rssi_dbm) : json()}, {"source", message.source},
            {"missed", message.missed}, {"value", message.value}};
}

struct Driver {
    captain_client::Station box;
    std::optional<captain_client::Sent> sent{};
    std::optional<captain_client::Listener> listener{};
    std::optional<captain_client::Reports> reports{};
    captain_client::Message last{};

    json answer(const json &question)
    {
        const std::string verb = question["do"], type = question.value("type", "");
        const json options = question.value("options", json());
        if (verb == "send")
            return sent = box.send(type, question.value("fields", json::object()), options), sent->label();
        if (verb == "send_braces") // compilers differ in the meaning of some
            return sent = box.send(type, {{"speed", 13.9}}, {{"lifetime_s", 2.0}, {"interfaces", json::array({"g5"})}}), sent->label();
        if (verb == "send_message")
            return sent = box.send_message(type, question["message"], form_of(question), options), sent->label();
        if (verb == "send_pdu")
            return sent = box.send_pdu(type, question["pdu"], options), sent->label();
        if (verb == "confirmed")
            return shown(sent->confirmed(captain_client::Milliseconds(question.value("timeout_ms", PATIENCE.count()))));
        if (verb == "listen")
            return listener = box.listen(question.value("types", std::vector<std::string>()), form_of(question)), json();
        if (verb == "listen_elsewhere")
            return listener = captain_client::Station(question["address"]).listen(), json();
        if (verb == "next") {
            const auto message = listener->next(captain_client::Milliseconds(question.value("timeout_ms", PATIENCE.count())));
            return message ? shown(last = *message) : json();
        }
        if (verb == "iterate") {
            json types = json::array();
            for (const auto &message : *listener)
                if (types.push_back(message.type); types.size() == question["count"])
                    break;
            return types;
        }
        if (verb == "get")
            return last.get(question["path"]);
        if (verb == "reports")
            return reports = box.reports(question["topics"]), json();
        if (verb == "report") {
            const auto report = reports->next(PATIENCE);
            return {report->topic, report->object, report->octets};
        }
        if (verb == "move") {
            captain_client::Station other = std::move(box);
            return box = std::move(other), json();
        }
        return verb == "missed" ? json(box.missed()) : box.status();
    }
};

static json answer(Driver &driver, const json &question)
try {
    return {{"said", driver.answer(question)}};
} catch (const captain_client::RefusedError &error) {
    json invalid = json::array();
    for (const auto &fault : error.invalid())
        invalid.push_back({fault.path, fault.problem, fault.value});
    return {{"error", "refused"}, {"what", error.what()}, {"reason", error.reason()}, {"detail", error.detail()}, {"invalid", invalid}};
} catch (const captain_client::UnconfirmedError &error) {
    return {{"error", "unconfirmed"}, {"what", error.what()}};
} catch (const captain_client::UnreachableError &error) {
    return {{"error", "unreachable"}, {"what", error.what()}};
} catch (const captain_client::Error &error) {
    return {{"error", "error"}, {"what", error.what()}, {"hint", error.hint()}};
}

int main(int, char **argv)
try {
    std::signal(SIGUSR1, [](int) {}); // ends waits
    Driver driver{captain_client::Station(argv[1], captain_client::Milliseconds(std::stoi(argv[2])))};
    std::cout << json{{"said", "connected"}} << std::endl;
    for (std::string line; std::getline(std::cin, line);)
        std::cout << answer(driver, json::parse(line)) << std::endl;
} catch (const captain_client::UnreachableError &error) {
    std::cout << json{{"error", "unreachable"}, {"what", error.what()}} << std::endl;
} catch (const std::invalid_argument &error) {
    std::cout << json{{"error", "invalid"}, {"what", error.what()}} << std::endl;
}
