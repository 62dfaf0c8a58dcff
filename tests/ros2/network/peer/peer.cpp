/* A peer on Fast DDS, ROS 2 Humble's default: as peer.c. Its socket buffer is large, else raw images are lost. */
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "rosPubSubTypes.h"

using namespace eprosima::fastdds::dds;

int main(int, char **argv)
{
  DomainParticipantQos participant_qos = PARTICIPANT_QOS_DEFAULT;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  udp->receiveBufferSize = 4 * 1024 * 1024;
  participant_qos.transport().use_builtin_transports = false;
  participant_qos.transport().user_transports.push_back(udp);
  participant_qos.transport().listen_socket_buffer_size = 4 * 1024 * 1024;
  auto *participant = DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), participant_qos);
  TypeSupport image_type(new sensor_msgs::msg::dds_::Image_PubSubType());
  TypeSupport twist_type(new geometry_msgs::msg::dds_::Twist_PubSubType());
  image_type.register_type(participant);
  twist_type.register_type(participant);
  auto topic = [&](const char *name, TypeSupport &type) {
    return participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  };
  DataReaderQos reader_qos = DATAREADER_QOS_DEFAULT;
  reader_qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  reader_qos.history().depth = 10;
  reader_qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  auto *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  auto *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  auto *images = subscriber->create_datareader(topic("rt/limo_camera/image", image_type), reader_qos);
  auto *heard = subscriber->create_datareader(topic("rt/heard", twist_type), reader_qos);
  auto *writer = publisher->create_datawriter(topic("rt/cmd_vel", twist_type), DATAWRITER_QOS_DEFAULT);

  geometry_msgs::msg::dds_::Twist_ command, said;
  sensor_msgs::msg::dds_::Image_ image;
  SampleInfo info;
  command.linear().x(0.5);
  command.angular().z(-0.25);
  int image_count = 0, twist_count = 0;
  unsigned long pixel_sum = 0;
  std::printf("ready\n");
  std::fflush(stdout);
  for (int i = 0; i < std::atoi(argv[2]); i++) {
    writer->write(&command);
    while (images->take_next_sample(&image, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) {
        image_count++;
        pixel_sum = 0;
        for (auto byte : image.data()) pixel_sum += byte;
      }
    while (heard->take_next_sample(&said, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) twist_count++;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  std::printf("{\"images\": %d, \"encoding\": \"%s\", \"pixel_sum\": %lu, \"twists\": %d, \"angular\": %g}\n",
              image_count, image.encoding().c_str(), pixel_sum, twist_count, said.angular().z());
  return 0;
}
