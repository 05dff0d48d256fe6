// Tables: textures of words. (Mesa's software driver reads a texel ten times as fast as it reads a storage buffer at a place that
// it does not know to be the same for all pixels.)

// Texels in a row of a table.
const TABLE_WIDTH: u32 = 1024u;

fn place_in_table(number: u32) -> vec2u {
    return vec2u(number % TABLE_WIDTH, number / TABLE_WIDTH);
}
