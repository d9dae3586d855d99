// SPDX-License-Identifier: BSD-3-Clause
// The picture for the viewers, in the messages of Drake's (DRAKE_VIEWER_LOAD_ROBOT, DRAKE_VIEWER_DRAW):
// drake.c says what is where. Slow thread.
#include "daemon/tell/telemetry_state.h"

static void put_quat(gv_quat q, float out[4]) {
  out[0] = (float)q.w;
  out[1] = (float)q.x;
  out[2] = (float)q.y;
  out[3] = (float)q.z;
}

void gv_telemetry_point_picture(gv_telemetry_picture *v) {
  static char no_file[] = "";
  for (int i = 0; i < v->drake.link_count; i++) {
    gv_drake_link *link = &v->drake.link[i];
    v->geometry[i] = (gloved_viewer_geometry_t){.type = (int8_t)link->type,
                                                .string_data = no_file,
                                                .num_float_data = link->number_count,
                                                .float_data = &v->drake.number[link->number_first]};
    v->geometry[i].position[0] = (float)link->p_link_shape.x;
    v->geometry[i].position[1] = (float)link->p_link_shape.y;
    v->geometry[i].position[2] = (float)link->p_link_shape.z;
    put_quat(link->q_link_shape, v->geometry[i].quaternion);
    memcpy(v->geometry[i].color, link->color, sizeof link->color);
    v->link[i] = (gloved_viewer_link_t){
      .name = link->name, .num_geom = link->number_count > 0, .geom = &v->geometry[i]};
    v->name[i] = link->name;
    v->position_row[i] = v->position[i];
    v->quaternion_row[i] = v->quaternion[i];
  }
}

static void send_load(gv_telemetry *telemetry, int64_t utime) {
  gv_telemetry_picture *v = &telemetry->viewer;
  const gloved_viewer_load_t load = {.num_links = v->drake.link_count, .link = v->link};
  gv_telemetry_send(telemetry, "DRAKE_VIEWER_LOAD_ROBOT", utime,
                    gloved_viewer_load_t_encode(telemetry->message, 0, MESSAGE_MAX, &load));
}

static void send_draw(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  gv_telemetry_picture *v = &telemetry->viewer;
  gv_drake_update(&v->drake, snapshot);
  for (int i = 0; i < v->drake.link_count; i++) {
    const gv_pose *T = &v->drake.T_world_link[i];
    v->position[i][0] = (float)T->p.x;
    v->position[i][1] = (float)T->p.y;
    v->position[i][2] = (float)T->p.z;
    put_quat(T->q, v->quaternion[i]);
  }
  const gloved_viewer_draw_t draw = {.timestamp = (int64_t)(snapshot->time_s * 1e3),
                                     .num_links = v->drake.link_count,
                                     .link_name = v->name,
                                     .robot_num = v->robot,
                                     .position = v->position_row,
                                     .quaternion = v->quaternion_row};
  gv_telemetry_send(telemetry, "DRAKE_VIEWER_DRAW", snapshot->utime,
                    gloved_viewer_draw_t_encode(telemetry->message, 0, MESSAGE_MAX, &draw));
}

// A viewer that starts later shows nothing before it gets the shapes, and then poses: in this order.
void gv_telemetry_send_picture(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  gv_telemetry_picture *v = &telemetry->viewer;
  if (!gv_telemetry_is_due(&v->next_draw_us, snapshot->utime, DRAW_US))
    return;
  if (gv_telemetry_is_due(&v->next_load_us, snapshot->utime, LOAD_US))
    send_load(telemetry, snapshot->utime);
  send_draw(telemetry, snapshot);
}
