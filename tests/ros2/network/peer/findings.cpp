/* A peer on Fast DDS: as findings.c. */
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
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

static DomainParticipant *participant;
static Subscriber *subscriber;

template <class Type> static Topic *topic(const char *name)
{
  TypeSupport type(new Type());
  type.register_type(participant);
  return participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
}

template <class Type> static DataReader *reader(const char *name)
{
  DataReaderQos qos = DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.history().depth = 10;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return subscriber->create_datareader(topic<Type>(name), qos);
}

template <class... Values> static std::string text(const char *format, Values... values)
{
  char line[256];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

int main(int, char **argv)
{
  DomainParticipantQos participant_qos = PARTICIPANT_QOS_DEFAULT;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  participant_qos.transport().use_builtin_transports = false;
  participant_qos.transport().user_transports.push_back(udp);
  participant = DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), participant_qos);
  subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  auto *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  auto *poses = reader<geometry_msgs::msg::dds_::PoseStamped_PubSubType>("rt/followed_person");
  auto *boxes = reader<vision_msgs::msg::dds_::Detection2DArray_PubSubType>("rt/detections");
  auto *people = reader<people_msgs::msg::dds_::People_PubSubType>("rt/people");
  auto *frames = reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>("rt/tf");
  auto *writer = publisher->create_datawriter(
      topic<geometry_msgs::msg::dds_::TwistStamped_PubSubType>("rt/cmd_vel"), DATAWRITER_QOS_DEFAULT);

  geometry_msgs::msg::dds_::TwistStamped_ command;
  command.header().stamp().sec(12);
  command.header().stamp().nanosec(500000000);
  command.header().frame_id("base_link");
  command.twist().linear().x(0.5);
  command.twist().angular().z(-0.25);
  geometry_msgs::msg::dds_::PoseStamped_ pose;
  vision_msgs::msg::dds_::Detection2DArray_ found;
  people_msgs::msg::dds_::People_ known;
  tf2_msgs::msg::dds_::TFMessage_ tree;
  SampleInfo info;
  std::string said[4];
  std::printf("ready\n");
  std::fflush(stdout);
  for (int i = 0; i < std::atoi(argv[2]); i++) {
    writer->write(&command);
    while (poses->take_next_sample(&pose, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data)
        said[0] = text("%d.%u %s %g %g %g", pose.header().stamp().sec(), pose.header().stamp().nanosec(),
                       pose.header().frame_id().c_str(), pose.pose().position().x(), pose.pose().position().y(),
                       pose.pose().orientation().w());
    while (boxes->take_next_sample(&found, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) {
        auto &one = found.detections()[0];
        auto &guess = one.results()[0].hypothesis();
        said[1] = text("%u %s %s %g %g %g %s", unsigned(found.detections().size()), one.id().c_str(),
                       guess.class_id().c_str(), guess.score(), one.bbox().center().position().x(),
                       one.bbox().size_y(), found.detections()[1].id().c_str());
      }
    while (people->take_next_sample(&known, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) {
        auto &one = known.people()[0];
        said[2] = text("%u %s %g %g %g", unsigned(known.people().size()), one.name().c_str(), one.position().x(),
                       one.velocity().y(), one.reliability());
      }
    while (frames->take_next_sample(&tree, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) {
        auto &one = tree.transforms()[0];
        said[3] = text("%u %s %s %g", unsigned(tree.transforms().size()), one.header().frame_id().c_str(),
                       one.child_frame_id().c_str(), one.transform().translation().x());
      }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  std::printf("[\"%s\", \"%s\", \"%s\", \"%s\"]\n", said[0].c_str(), said[1].c_str(), said[2].c_str(), said[3].c_str());
  return 0;
}
