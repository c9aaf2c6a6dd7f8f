"""Messages that drives are recorded with and whose packages are not installed.

A bag carries its definitions, as a rule; where an older one carries none, these are taken by name.
Fields in the order of the packages' own files.
"""

_ESR_TRACK = """
std_msgs/Header header
string canmsg
uint8 id
float32 lat_rate
bool grouping_changed
bool oncoming
uint8 status
float32 angle
float32 range
bool bridge_object
bool rolling_count
float32 width
float32 range_accel
uint8 med_range_mode
float32 range_rate
"""

_ESR_STATUS_4 = """
std_msgs/Header header
string canmsg
bool truck_target_det
bool lr_only_grating_lobe_det
bool sidelobe_blockage
bool partial_blockage
uint8 mr_lr_mode
uint8 rolling_count_3
uint8 path_id_acc
uint8 path_id_cmbb_move
uint8 path_id_cmbb_stat
uint8 path_id_fcw_move
uint8 path_id_fcw_stat
float32 auto_align_angle
uint8 path_id_acc_stat
"""

_RADAR_TRACK = """
uint16 NO_CLASSIFICATION=0
uint16 STATIC=1
uint16 DYNAMIC=2
unique_identifier_msgs/UUID uuid
geometry_msgs/Point position
geometry_msgs/Vector3 velocity
geometry_msgs/Vector3 acceleration
geometry_msgs/Vector3 size
uint16 classification
float32[6] position_covariance
float32[6] velocity_covariance
float32[6] acceleration_covariance
float32[6] size_covariance
"""

_RADAR_TRACKS = """
std_msgs/Header header
radar_msgs/RadarTrack[] tracks
"""

_CAN_FRAME = """
std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data
"""

DEFINITIONS = {
    "delphi_esr_msgs/msg/EsrTrack": _ESR_TRACK,
    "delphi_esr_msgs/msg/EsrStatus4": _ESR_STATUS_4,
    "radar_msgs/msg/RadarTrack": _RADAR_TRACK,
    "radar_msgs/msg/RadarTracks": _RADAR_TRACKS,
    "can_msgs/msg/Frame": _CAN_FRAME,
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid\n",
}
"""Definition by type name."""
