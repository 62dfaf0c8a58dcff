/* A peer on Cyclone DDS's C library: sends Twist, receives Twist and Image, and says what came as JSON. */
#include <stdio.h>
#include <stdlib.h>
#include "dds/dds.h"
#include "ros.h"

int main(int argc, char **argv)
{
  const int periods = argc > 2 ? atoi(argv[2]) : 100;
  dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  dds_entity_t images = dds_create_topic(participant, &sensor_msgs_msg_dds__Image__desc, "rt/limo_camera/image", NULL, NULL);
  dds_entity_t heard = dds_create_topic(participant, &geometry_msgs_msg_dds__Twist__desc, "rt/heard", NULL, NULL);
  dds_entity_t command = dds_create_topic(participant, &geometry_msgs_msg_dds__Twist__desc, "rt/cmd_vel", NULL, NULL);
  dds_entity_t image_reader = dds_create_reader(participant, images, qos, NULL);
  dds_entity_t twist_reader = dds_create_reader(participant, heard, qos, NULL);
  dds_entity_t writer = dds_create_writer(participant, command, qos, NULL);
  geometry_msgs_msg_dds__Twist_ twist = {{0.5, 0, 0}, {0, 0, -0.25}};
  int image_count = 0, twist_count = 0;
  unsigned long pixel_sum = 0;
  double angular = 0;
  char encoding[32] = "";
  if (participant < 0 || image_reader < 0 || twist_reader < 0 || writer < 0) return 1;
  printf("ready\n");
  fflush(stdout);
  for (int i = 0; i < periods; i++) {
    void *samples[1] = {NULL};
    dds_sample_info_t info[1];
    dds_write(writer, &twist);
    while (dds_take(image_reader, samples, info, 1, 1) > 0) {
      if (info[0].valid_data) {
        sensor_msgs_msg_dds__Image_ *image = samples[0];
        image_count++;
        pixel_sum = 0;
        for (uint32_t j = 0; j < image->data._length; j++) pixel_sum += image->data._buffer[j];
        snprintf(encoding, sizeof encoding, "%s", image->encoding);
      }
      dds_return_loan(image_reader, samples, 1);
      samples[0] = NULL;
    }
    while (dds_take(twist_reader, samples, info, 1, 1) > 0) {
      if (info[0].valid_data) {
        twist_count++;
        angular = ((geometry_msgs_msg_dds__Twist_ *)samples[0])->angular.z;
      }
      dds_return_loan(twist_reader, samples, 1);
      samples[0] = NULL;
    }
    dds_sleepfor(DDS_MSECS(20));
  }
  printf("{\"images\": %d, \"encoding\": \"%s\", \"pixel_sum\": %lu, \"twists\": %d, \"angular\": %g}\n",
         image_count, encoding, pixel_sum, twist_count, angular);
  dds_delete(participant);
  return 0;
}
