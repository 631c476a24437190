#version 300 es
// The picture as it is, where nothing lies between it and the wall: pixel by pixel.
precision mediump float;
precision mediump sampler2D;

uniform sampler2D picture;

out vec4 colour;

void main() {
    colour = vec4(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, 1.0);
}
