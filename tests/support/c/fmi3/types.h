/* Every type, in and out; integers are counted up, texts lengthened. */
#define TOKEN "types"
typedef struct Model {
    double time, f64_in, f64_out, from_file;
    float f32_in, f32_out;
    int8_t i8_in, i8_out;
    uint8_t u8_in, u8_out;
    int16_t i16_in, i16_out;
    uint16_t u16_in, u16_out;
    int32_t i32_in, i32_out, whole[2][3], sum;
    uint32_t u32_in, u32_out;
    int64_t i64_in, i64_out, mood_in, mood_out;
    uint64_t u64_in, u64_out;
    fmi3Boolean bool_in, bool_out, bits[3], parity;
    char word[TEXT], words[2][TEXT];
    int32_t length;
    Blob blob, blobs[2], mirrored;
} Model;
enum { COUNT_OF_STATES = 0, STATES_AT = 0, RATES_AT = 0 };
#define PAIR(reference, type, name)                                                                                    \
    {reference, type, 1, offsetof(Model, name##_in), 1}, { reference + 1, type, 1, offsetof(Model, name##_out), 0 }
static const Slot SLOTS[] = {
    {0, FLOAT64, 1, offsetof(Model, time), 0},
    PAIR(1, FLOAT32, f32),
    PAIR(3, FLOAT64, f64),
    PAIR(5, INT8, i8),
    PAIR(7, UINT8, u8),
    PAIR(9, INT16, i16),
    PAIR(11, UINT16, u16),
    PAIR(13, INT32, i32),
    PAIR(15, UINT32, u32),
    PAIR(17, INT64, i64),
    PAIR(19, UINT64, u64),
    PAIR(21, BOOLEAN, bool),
    PAIR(23, INT64, mood),
    {25, STRING, 1, offsetof(Model, word), 1},
    {26, STRING, 2, offsetof(Model, words), 1},
    {27, INT32, 1, offsetof(Model, length), 0},
    {28, INT32, 6, offsetof(Model, whole), 1},
    {29, INT32, 1, offsetof(Model, sum), 0},
    {30, BOOLEAN, 3, offsetof(Model, bits), 1},
    {31, BOOLEAN, 1, offsetof(Model, parity), 0},
    {32, FLOAT64, 1, offsetof(Model, from_file), 0},
    {99, BINARY, 1, offsetof(Model, blob), 1},
    {33, BINARY, 2, offsetof(Model, blobs), 1},
    {34, BINARY, 1, offsetof(Model, mirrored), 0},
};
static void start(Model *m) {
    strcpy(m->word, "abc");
    strcpy(m->words[0], "de");
    strcpy(m->words[1], "f");
    m->mood_in = 1;
    m->blob = (Blob){2, {0x00, 0xff}};
    m->blobs[0] = m->blobs[1] = (Blob){1, {0x07}};
    for (int k = 0; k < 6; k++) m->whole[k / 3][k % 3] = k + 1;
}
static void evaluate(Model *m) {
    m->f32_out = 2.0f * m->f32_in;
    m->f64_out = 2.0 * m->f64_in;
    m->i8_out = (int8_t)(m->i8_in + 1);
    m->u8_out = (uint8_t)(m->u8_in + 1);
    m->i16_out = (int16_t)(m->i16_in + 1);
    m->u16_out = (uint16_t)(m->u16_in + 1);
    m->i32_out = m->i32_in + 1;
    m->u32_out = m->u32_in + 3000000000u;
    m->i64_out = m->i64_in - ((int64_t)1 << 50);
    m->u64_out = m->u64_in + ((uint64_t)1 << 52);
    m->mood_out = m->mood_in == 1 ? -4 : 1;
    m->bool_out = !m->bool_in;
    m->length = (int32_t)(strlen(m->word) + 10 * strlen(m->words[0]) + 100 * strlen(m->words[1]));
    m->sum = 0;
    for (int k = 0; k < 6; k++) m->sum += (k + 1) * m->whole[k / 3][k % 3];
    m->mirrored.size = m->blob.size + m->blobs[0].size + m->blobs[1].size;
    unsigned char *end = m->mirrored.bytes + m->mirrored.size;
    for (size_t k = 0; k < m->blob.size; k++) *--end = m->blob.bytes[k];
    for (int b = 0; b < 2; b++)
        for (size_t k = 0; k < m->blobs[b].size; k++) *--end = m->blobs[b].bytes[k];
    m->parity = m->bits[0] ^ m->bits[1] ^ m->bits[2];
}
static void advance(Model *m, double h) { (void)m, (void)h; }
static double next_event(const Model *m) {
    (void)m;
    return INFINITY;
}
static void handle_event(Model *m) { (void)m; }
static void tangent(Model *m) { m->f64_in = 0.0; }
#define NEEDS_RESOURCES from_file
