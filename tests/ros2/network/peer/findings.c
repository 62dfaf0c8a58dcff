/* A peer on Cyclone DDS's C library: sends TwistStamped, receives what the follower finds, and says it as JSON. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "dds/dds.h"
#include "ros.h"

static dds_entity_t participant, readers[4];
static char said[4][256];

static void listen_to(int i, const dds_topic_descriptor_t *type, const char *topic, const dds_qos_t *qos)
{
  readers[i] = dds_create_reader(participant, dds_create_topic(participant, type, topic, NULL, NULL), qos, NULL);
  if (readers[i] < 0) exit(1);
}

static void hear(int i, const void *sample)
{
  if (i == 0) {
    const geometry_msgs_msg_dds__PoseStamped_ *m = sample;
    snprintf(said[i], sizeof said[i], "%d.%u %s %g %g %g", m->header.stamp.sec, m->header.stamp.nanosec,
             m->header.frame_id, m->pose.position.x, m->pose.position.y, m->pose.orientation.w);
  } else if (i == 1) {
    const vision_msgs_msg_dds__Detection2DArray_ *m = sample;
    const vision_msgs_msg_dds__Detection2D_ *one = &m->detections._buffer[0];
    snprintf(said[i], sizeof said[i], "%u %s %s %g %g %g %s", m->detections._length, one->id,
             one->results._buffer[0].hypothesis.class_id, one->results._buffer[0].hypothesis.score,
             one->bbox.center.position.x, one->bbox.size_y, m->detections._buffer[1].id);
  } else if (i == 2) {
    const people_msgs_msg_dds__People_ *m = sample;
    snprintf(said[i], sizeof said[i], "%u %s %g %g %g", m->people._length, m->people._buffer[0].name,
             m->people._buffer[0].position.x, m->people._buffer[0].velocity.y, m->people._buffer[0].reliability);
  } else {
    const tf2_msgs_msg_dds__TFMessage_ *m = sample;
    snprintf(said[i], sizeof said[i], "%u %s %s %g", m->transforms._length, m->transforms._buffer[0].header.frame_id,
             m->transforms._buffer[0].child_frame_id, m->transforms._buffer[0].transform.translation.x);
  }
}

int main(int argc, char **argv)
{
  participant = dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  listen_to(0, &geometry_msgs_msg_dds__PoseStamped__desc, "rt/followed_person", qos);
  listen_to(1, &vision_msgs_msg_dds__Detection2DArray__desc, "rt/detections", qos);
  listen_to(2, &people_msgs_msg_dds__People__desc, "rt/people", qos);
  listen_to(3, &tf2_msgs_msg_dds__TFMessage__desc, "rt/tf", qos);
  dds_entity_t writer = dds_create_writer(participant,
      dds_create_topic(participant, &geometry_msgs_msg_dds__TwistStamped__desc, "rt/cmd_vel", NULL, NULL), qos, NULL);
  geometry_msgs_msg_dds__TwistStamped_ twist = {{{12, 500000000}, "base_link"}, {{0.5, 0, 0}, {0, 0, -0.25}}};
  printf("ready\n");
  fflush(stdout);
  for (int k = 0; k < atoi(argv[2]); k++) {
    dds_write(writer, &twist);
    for (int i = 0; i < 4; i++) {
      void *samples[1] = {NULL};
      dds_sample_info_t info[1];
      while (dds_take(readers[i], samples, info, 1, 1) > 0) {
        if (info[0].valid_data) hear(i, samples[0]);
        dds_return_loan(readers[i], samples, 1);
        samples[0] = NULL;
      }
    }
    dds_sleepfor(DDS_MSECS(20));
  }
  printf("[\"%s\", \"%s\", \"%s\", \"%s\"]\n", said[0], said[1], said[2], said[3]);
  dds_delete(participant);
  return 0;
}
