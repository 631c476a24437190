// The least ink where the figure is: less is the paper around it.
const float DRAWN = 0.45;
