// A peer over eProsima Fast DDS, the middleware of ROS 2's default rmw: echoes what it hears, as ROS 2 types.
//
// usage: echo_peer DOMAIN
// Hears geometry_msgs Twist on rt/twist_to_peer (reliable reader) and tf2_msgs TFMessage on rt/tf_to_peer (best-effort
// reader), prints each as decoded, and sends it on to rt/twist_from_peer (best-effort writer) and rt/tf_from_peer
// (reliable writer), decoded and encoded anew by Fast CDR. Says "match N" when its matches change. A line of hexadecimal
// digits on its standard input is sent as it is, as the payload of a TFMessage. Ends when its standard input does.

#include <cstdio>
#include <functional>
#include <iostream>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

constexpr uint32_t LARGEST = 4096;  // bytes of a payload that the peer sends or hears

struct Twist {
    double v[6];
    void write(Cdr& out) const { for (double x : v) out << x; }
    void read(Cdr& in) { for (double& x : v) in >> x; }
    void print() const { for (double x : v) std::printf(" %.17g", x); }
};

struct Transform {
    int32_t sec;
    uint32_t nanosec;
    std::string frame, child;
    double v[7];
};

struct TF {
    std::vector<Transform> transforms;
    std::string raw;  // if not empty, sent instead
    void write(Cdr& out) const {
        if (!raw.empty()) {
            out.serializeArray(raw.data(), raw.size());
            return;
        }
        out << static_cast<uint32_t>(transforms.size());
        for (const auto& t : transforms) {
            out << t.sec << t.nanosec << t.frame << t.child;
            for (double x : t.v) out << x;
        }
    }
    void read(Cdr& in) {
        uint32_t n;
        in >> n;
        transforms.clear();
        for (uint32_t i = 0; i < n; ++i) {
            Transform t;
            in >> t.sec >> t.nanosec >> t.frame >> t.child;
            for (double& x : t.v) in >> x;
            transforms.push_back(t);
        }
    }
    void print() const {
        for (const auto& t : transforms) {
            std::printf(" %d %u %s %s", t.sec, t.nanosec, t.frame.c_str(), t.child.c_str());
            for (double x : t.v) std::printf(" %.17g", x);
        }
    }
};

template <class T>
struct Type : TopicDataType {
    explicit Type(const char* name) {
        setName(name);
        m_typeSize = LARGEST;
        // matched by name alone: no XTypes description of its own
        auto_fill_type_information(false);
        auto_fill_type_object(false);
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
        Cdr out(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        payload->encapsulation = CDR_LE;
        out.serialize_encapsulation();
        static_cast<T*>(data)->write(out);
        payload->length = static_cast<uint32_t>(out.getSerializedDataLength());
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        try {
            FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
            Cdr in(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
            in.read_encapsulation();
            static_cast<T*>(data)->read(in);
            return true;
        } catch (const eprosima::fastcdr::exception::Exception& error) {
            std::printf("bad %s\n", error.what());
            return false;
        }
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override { return [] { return LARGEST; }; }
    void* createData() override { return new T; }
    void deleteData(void* data) override { delete static_cast<T*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

static int matches = 0;
static void matched(int change) {
    static std::mutex guard;
    std::lock_guard<std::mutex> lock(guard);
    matches += change;
    std::printf("match %d\n", matches);
    std::fflush(stdout);
}

struct WriterEnd : DataWriterListener {
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        matched(status.current_count_change);
    }
};

template <class T>
struct ReaderEnd : DataReaderListener {
    const char* label;
    DataWriter* writer;
    ReaderEnd(const char* name, DataWriter* back) : label(name), writer(back) {}
    void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
        matched(status.current_count_change);
    }
    void on_data_available(DataReader* reader) override {
        T message;
        SampleInfo info;
        while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::printf("%s", label);
            message.print();
            std::printf("\n");
            std::fflush(stdout);
            writer->write(&message);
        }
    }
};

struct Ends {
    DataWriter* writer;
    std::unique_ptr<DataWriterListener> sends;
    std::unique_ptr<DataReaderListener> hears;
};

template <class T>
Ends echo(DomainParticipant* node, const char* label, const char* type, bool reliable_reader) {
    TypeSupport support(new Type<T>(type));
    support.register_type(node);
    const std::string topic = std::string("rt/") + label;
    DataWriterQos wqos;
    wqos.reliability().kind = reliable_reader ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
    wqos.durability().kind = VOLATILE_DURABILITY_QOS;
    wqos.history().depth = 10;
    DataReaderQos rqos;
    rqos.reliability().kind = reliable_reader ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    rqos.durability().kind = VOLATILE_DURABILITY_QOS;
    rqos.history().depth = 10;
    Ends ends;
    ends.sends.reset(new WriterEnd);
    auto* out = node->create_topic(topic + "_from_peer", type, TOPIC_QOS_DEFAULT);
    auto* writer = node->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(out, wqos, ends.sends.get());
    ends.writer = writer;
    ends.hears.reset(new ReaderEnd<T>(label, writer));
    auto* in = node->create_topic(topic + "_to_peer", type, TOPIC_QOS_DEFAULT);
    node->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(in, rqos, ends.hears.get());
    return ends;
}

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    DomainParticipantQos qos;
    qos.name("fastdds_echo_peer");
    // UDP on the loopback interface, found by unicast: containers may have no multicast
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    eprosima::fastrtps::rtps::Locator_t peer;
    peer.kind = LOCATOR_KIND_UDPv4;
    eprosima::fastrtps::rtps::IPLocator::setIPv4(peer, "127.0.0.1");
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    auto* factory = DomainParticipantFactory::get_instance();
    auto* node = factory->create_participant(std::stoi(argv[1]), qos);
    if (node == nullptr) return 1;
    Ends twist = echo<Twist>(node, "twist", "geometry_msgs::msg::dds_::Twist_", true);
    Ends tf = echo<TF>(node, "tf", "tf2_msgs::msg::dds_::TFMessage_", false);
    std::printf("ready\n");
    std::fflush(stdout);
    for (std::string line; std::getline(std::cin, line);) {
        TF message;
        for (size_t i = 0; i + 1 < line.size(); i += 2)
            message.raw += static_cast<char>(std::stoi(line.substr(i, 2), nullptr, 16));
        if (!message.raw.empty()) tf.writer->write(&message);
    }
    node->delete_contained_entities();
    factory->delete_participant(node);
    return 0;
}
